"""Pin the catalogue anew, with the reason: `python -m tests.golden.catalogue.pin "why the numbers moved"`."""

from __future__ import annotations

import sys
from datetime import UTC, datetime

from tests.pinned_kernels import choose

choose()  # before numpy is imported

from tests.golden.catalogue.pins import FILE, QUANTITIES, Pin, cases, environment, read, run_case  # noqa: E402

HEADER = (
    "# SHA-256 of history.csv of every case of the catalogue, and the last row of its first inverter:\n"
    f"# {', '.join(QUANTITIES)}. Written by tests/golden/catalogue/pin.py; see README.md beside it.\n"
)


def main(reason: str) -> None:
    """Run the catalogue, print what moved, and write the pins."""
    old, moved = ({}, []) if not FILE.exists() else (lambda whole: (whole[0], whole[2]))(read())
    new: dict[tuple[str, str], Pin] = {}
    for name, case in cases():
        pin = new[name, case] = run_case(name, case)
        before = old.get((name, case))
        if before is None or before.sha256 != pin.sha256:
            print(f"{name} {case}: {'new' if before is None else _difference(before, pin)}")
    for name, case in sorted(old.keys() - new.keys()):
        print(f"{name} {case}: gone")
    changed = sorted({name for name, case in new.keys() | old.keys() if old.get((name, case)) != new.get((name, case))})
    if not changed:
        print("nothing moved; the pins stay as they are")
        return
    moved.append({"date": datetime.now(UTC).date().isoformat(), "scenarios": " ".join(changed), "reason": reason})
    FILE.write_text(_toml(new, moved), encoding="utf-8")


def _difference(before: Pin, after: Pin) -> str:
    pairs = zip(QUANTITIES, before.last, after.last, strict=True)
    return ", ".join(f"{name} {old:.6g} -> {new:.6g}" for name, old, new in pairs)


def _toml(pins: dict[tuple[str, str], Pin], moved: list[dict[str, str]]) -> str:
    lines = [HEADER, "[environment]", *(f'{key} = "{value}"' for key, value in environment().items())]
    for entry in moved:
        lines += ["", "[[moved]]", *(f"{key} = {_quoted(value)}" for key, value in entry.items())]
    for name in dict.fromkeys(name for name, _ in pins):
        lines += ["", f"[pin.{name}]"]
        for (of, case), pin in pins.items():
            if of == name:
                lines.append(f'{case} = {{ sha256 = "{pin.sha256}", last = {list(pin.last)} }}')
    return "\n".join(lines) + "\n"


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit('usage: python -m tests.golden.catalogue.pin "why the numbers moved"')
    main(sys.argv[1])
