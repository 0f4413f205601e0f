"""Runs the cross-validation and writes docs/validation.md: python -m bench.validation [PART ...]."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command does, before numpy is imported

from bench.harness import say
from bench.validation.validation_page import DOCS, write_page
from bench.validation.validation_part import CaseResult, ValidationPart
from bench.validation.validation_parts import PARTS


def main(
    arguments: Sequence[str] | None = None, all_parts: Sequence[ValidationPart] = PARTS, folder: Path = DOCS
) -> int:
    """Run parts and write the page: 0 all limits are kept, 1 one is broken, 2 a part cannot run."""
    parser = argparse.ArgumentParser(prog="python -m bench.validation", description="Write docs/validation.md.")
    names = ", ".join(part.name for part in all_parts)
    parser.add_argument("parts", nargs="*", metavar="part", help=f"{names}; all of them by default")
    given = parser.parse_args(arguments).parts
    if unknown := [name for name in given if name not in names.split(", ")]:
        parser.error(f'part "{unknown[0]}": there is no such part; choose from {names}')
    chosen = [part for part in all_parts if not given or part.name in given]
    if missing := [part.missing() for part in chosen if part.missing()]:
        print("\n".join(missing), file=sys.stderr)
        return 2
    results: dict[str, list[CaseResult]] = {}
    broken = []
    for part in chosen:
        for case in part.cases:
            say(f"{part.name}: {case}")
            result = part.run(case)
            results.setdefault(part.name, []).append(result)
            broken += [f"{part.name}: {problem}" for problem in result.broken()]
            numbers = ", ".join(
                f"{check.quantity} {check.text()} ({'at least' if check.at_least else 'at most'} {check.limit:g})"
                for check in result.checks
            )
            print(f"  {'holds' if not result.broken() else 'BROKEN'}: {numbers}")
    print(write_page(all_parts, results, folder))
    if broken:
        print("\n".join(broken), file=sys.stderr)
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
