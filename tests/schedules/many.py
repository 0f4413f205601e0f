"""Carry out many schedules by hand: `python -m tests.schedules.many 100 [FIRST_SEED] [--no-switchings] [--events]`."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from tests.schedules.carry_out import Verdict, carry_out, summary


def main(words: list[str]) -> None:
    """Run the schedules one after the other, a line each, and tell what came of them in all."""
    switchings = "--no-switchings" not in words
    count, *rest = (int(word) for word in words if not word.startswith("--"))
    first = rest[0] if rest else 0
    verdicts: list[Verdict] = []
    for seed in range(first, first + count):
        folder = Path(tempfile.mkdtemp(prefix=f"schedule{seed}-"))
        verdict = carry_out(seed, folder, switchings=switchings)
        verdicts.append(verdict)
        print(verdict, flush=True)
        if "--events" in words or verdict.broke or verdict.outlived or any(t > 6.0 for t in verdict.back.values()):
            print(*(f"    {action}" for action in verdict.actions), sep="\n")
            print(*(f"      {event}" for event in verdict.events), f"    logs: {folder}", sep="\n", flush=True)
    print(summary(verdicts))


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    main(sys.argv[1:])
