"""Pin the catalogue anew, with the reason: `python -m tests.golden.catalogue.pin "why the numbers moved"`.

With `--otherwise` in place of a reason the pins stay, and those that are others on this processor are added.
"""

from __future__ import annotations

import sys
from datetime import UTC, datetime

from tests.pinned_kernels import choose

choose()  # before numpy is imported

from tests.golden.catalogue.pins import (  # noqa: E402
    FILE,
    QUANTITIES,
    Pin,
    Pinned,
    cases,
    environment,
    read,
    run_case,
    vector_level,
)

OTHERWISE = "--otherwise"

HEADER = (
    "# SHA-256 of the rows (float64) of every case of the catalogue, and the last row of its first inverter:\n"
    f"# {', '.join(QUANTITIES)}. Written by tests/golden/catalogue/pin.py; see README.md beside it.\n"
)


def main(reason: str) -> None:
    """Run the catalogue, print what moved, and write the pins."""
    pinned = read()
    old, new = pinned.here(), dict[tuple[str, str], Pin]()
    for name, case in cases():
        pin = new[name, case] = run_case(name, case)
        before = old.get((name, case))
        if before is None or before.sha256 != pin.sha256:
            print(f"{name} {case}: {'new' if before is None else _difference(before, pin)}")
    for name, case in sorted(old.keys() - new.keys()):
        print(f"{name} {case}: gone")
    changed = {key for key in new.keys() | old.keys() if old.get(key) != new.get(key)}
    if not changed:
        print("nothing moved; the pins stay as they are")
        return
    if reason == OTHERWISE:
        here = pinned.otherwise.get(vector_level(), {}) | {key: pin for key, pin in new.items() if key in changed}
        pinned.otherwise[vector_level()] = here
        write(pinned)
        return
    scenarios = " ".join(sorted({name for name, _ in changed}))
    pinned.moved.append({"date": datetime.now(UTC).date().isoformat(), "scenarios": scenarios, "reason": reason})  # noqa: TID251
    stay = {key: pin for key, pin in pinned.pins.items() if key in new and key not in changed}
    otherwise = {
        level: {key: pin for key, pin in pins.items() if key in stay} for level, pins in pinned.otherwise.items()
    }
    write(Pinned(new | stay, otherwise, environment(), pinned.moved))


def _difference(before: Pin, after: Pin) -> str:
    pairs = zip(QUANTITIES, before.last, after.last, strict=True)
    return ", ".join(f"{name} {old:.6g} -> {new:.6g}" for name, old, new in pairs)


def write(pinned: Pinned) -> None:
    lines = [HEADER, "[environment]", *(f'{key} = "{value}"' for key, value in pinned.environment.items())]
    for entry in pinned.moved:
        lines += ["", "[[moved]]", *(f"{key} = {_quoted(value)}" for key, value in entry.items())]
    lines += _tables("pin", pinned.pins)
    for level, pins in pinned.otherwise.items():
        lines += _tables(f"otherwise.{level}", pins)
    FILE.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _tables(table: str, pins: dict[tuple[str, str], Pin]) -> list[str]:
    lines = []
    for name in dict.fromkeys(name for name, _ in pins):
        lines += ["", f"[{table}.{name}]"]
        for (of, case), pin in pins.items():
            if of == name:
                lines.append(f'{case} = {{ sha256 = "{pin.sha256}", last = {list(pin.last)} }}')
    return lines


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit('usage: python -m tests.golden.catalogue.pin "why the numbers moved"')
    main(sys.argv[1])
