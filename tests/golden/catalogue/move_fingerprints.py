"""Move the pins from the hash of history.csv to that of the rows: `python -m tests.golden.catalogue.move_fingerprints`.

Of the rows of each case both hashes are computed. Where the old one is the pinned one, the new one takes its place; any
other case ends the move, and the pins stay. Pins of other processors are left without a hash.
"""

from __future__ import annotations

import sys
from hashlib import sha256

from tests.pinned_kernels import choose

choose()  # before numpy is imported

from gridpeers.scenarios.results.tables import header  # noqa: E402
from tests.golden.catalogue.pin import write  # noqa: E402
from tests.golden.catalogue.pins import cases, environment, ran, read, vector_level  # noqa: E402


def old_and_new(name: str, case: str) -> tuple[str, str]:
    """Return the hash of the text that history.csv has, and the fingerprint, of the same rows."""
    recorded, _ = ran(name, case)
    table = recorded.history.table
    text = "".join(",".join(map(str, row)) + "\n" for row in [header(recorded.inverters), *table.tolist()])
    new = sha256(table.astype("<f8").tobytes()).hexdigest()
    assert new == recorded.sha256, "the rows are not those that were hashed as they came"
    return sha256(text.encode("ascii")).hexdigest(), new


def main() -> None:
    """Move all pins, or none."""
    pinned = read()
    if environment() != pinned.environment:
        sys.exit(f"the pins are those of another environment: {pinned.environment}, here {environment()}")
    here, own = pinned.here(), pinned.otherwise.get(vector_level(), {})
    moved = {}
    for name, case in cases():
        old, new = old_and_new(name, case)
        if old != here[name, case].sha256:
            sys.exit(f"{name} {case}: its rows have the old hash {old}, pinned is {here[name, case].sha256}")
        moved[name, case] = here[name, case]._replace(sha256=new)
        print(f"{name} {case}: {old[:12]} -> {new[:12]}", flush=True)
    for key, pin in pinned.pins.items():
        pinned.pins[key] = pin._replace(sha256="") if key in own else moved[key]
    for level, pins in pinned.otherwise.items():
        pinned.otherwise[level] = {
            key: moved[key] if level == vector_level() else pin._replace(sha256="") for key, pin in pins.items()
        }
    pinned.moved.append(
        {
            "date": "2026-11-27",
            "scenarios": " ".join(sorted({name for name, _ in moved})),
            "reason": "The fingerprint is that of the rows as float64, no longer that of the text of history.csv: the "
            "rows behind each pin are those of the old one, as move_fingerprints.py has proven; none moved",
        }
    )
    write(pinned)


if __name__ == "__main__":
    main()
