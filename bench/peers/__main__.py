"""Ours beside its peers: python -m bench.peers [PART ...] [--write docs].

Exit code: 0 all is measured, or its rival is not installed; 1 something failed, and is named; 2 bad usage.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command does, before numpy is imported

from rich.console import Console

from bench.peers import machine_use
from bench.peers.bench_progress import progress, usual_seconds, usual_text
from bench.peers.measured import PartRun, measure_in_turns
from bench.peers.page import tables_text
from bench.peers.parts import PARTS, SHORT, Extent
from bench.peers.publish import DOCS, in_order, keep, publish
from bench.peers.stored import DATA_FILE, StoredError, read_parts


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print the tables, and write what is asked for."""
    given = _arguments(arguments)
    folder = given.page or given.write
    files = [file for file in (folder and folder / DATA_FILE, given.json) if file]
    try:
        known = read_parts(DOCS / DATA_FILE)  # for the usual times
        measured = {name: part for file in reversed(files) for name, part in read_parts(file).items()}
    except StoredError as error:
        print(error, file=sys.stderr)
        return 2
    if given.page:
        if not measured:
            print(f"{folder / DATA_FILE}: no measurements; run python -m bench.peers --write {folder}", file=sys.stderr)
            return 2
        print(publish(folder))
        return 0
    names = [name for name in given.parts or PARTS if not (given.resume and _is_whole(measured.get(name)))]
    extent = SHORT if given.short else Extent(rounds=max(1, given.repeat))
    try:
        failures = _measure(names, extent, known | measured, measured, files)
    except KeyboardInterrupt:
        stored = files and files[0].exists()
        kept = f"; whole parts are in {files[0]}, --resume measures the others" if stored else ""
        print(f"interrupted{kept}", file=sys.stderr)
        return 130
    print(tables_text(in_order(measured)))
    if given.write:
        print(publish(given.write))
    print("\n".join(failures), end="\n" if failures else "", file=sys.stderr)
    return 1 if failures else 0


def _measure(
    names: Sequence[str], extent: Extent, usual: dict[str, PartRun], measured: dict[str, PartRun], files: Sequence[Path]
) -> list[str]:
    """Measure parts, store each once it is whole, and return a line for each measure that failed."""
    console = Console(stderr=True)
    times = {name: usual_seconds(usual, name, extent.rounds) for name in names}
    console.print(usual_text(times), markup=False, highlight=False, soft_wrap=True)
    failures = []
    with progress(console, times, usual) as shown:
        for name in names:
            run = measure_in_turns(partial(PARTS[name].measures, extent), extent.rounds, partial(shown.tell, name))
            shown.done(name)
            measured[name] = run
            keep(name, run, *files)
            lines = [f"{name}: {measure}: {why}" for measure, why in run.left_out.items()]
            for line in lines:
                console.print(f"left out: {line}", markup=False, highlight=False, soft_wrap=True)
            failures += lines if run.failed else []
    return failures


def _is_whole(part: PartRun | None) -> bool:
    return part is not None and not part.failed and part.commit == machine_use.commit()


def _arguments(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m bench.peers", description="Measure ours beside its peers.")
    words = "; ".join(f"{name}: {part.text}" for name, part in PARTS.items())
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"{words}. All of them by default")
    parser.add_argument("--repeat", type=int, default=5, metavar="N", help="rounds (default 5; some have fewer)")
    parser.add_argument(
        "--write", type=Path, metavar="DIR", help=f"write performance.md, its figures and {DATA_FILE} there"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the measurements there")
    parser.add_argument("--resume", action="store_true", help="only parts that are not stored whole, of this commit")
    parser.add_argument(
        "--page",
        type=Path,
        nargs="?",
        const=DOCS,
        metavar="DIR",
        help=f"measure nothing: write performance.md in DIR (docs by default) anew from its {DATA_FILE}",
    )
    parser.add_argument("--short", action="store_true", help="as little as a test needs: its numbers mean nothing")
    given = parser.parse_args(arguments)
    if unknown := [name for name in given.parts if name not in PARTS]:
        parser.error(f'part "{unknown[0]}": there is no such part; choose from {", ".join(PARTS)}')
    if given.page and (given.parts or given.write or given.json or given.resume):
        parser.error("--page: goes with no part and no other option, it measures nothing")
    if given.resume and not (given.write or given.json):
        parser.error("--resume: goes with --write DIR or --json FILE, where the measured parts are")
    return given


if __name__ == "__main__":
    sys.exit(main())
