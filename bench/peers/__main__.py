"""Ours beside its peers: python -m bench.peers [PART ...] [--write docs]."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command does, before numpy is imported

import msgspec

from bench.harness import say
from bench.peers.measured import measure_in_turns
from bench.peers.page import read_parts, text_of, write_page
from bench.peers.parts import PARTS, SHORT, Extent


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print the tables, and write what is asked for."""
    parser = argparse.ArgumentParser(prog="python -m bench.peers", description=__doc__)
    words = "; ".join(f"{name}: {part.text}" for name, part in PARTS.items())
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"{words}. All of them by default")
    parser.add_argument("--repeat", type=int, default=5, metavar="N", help="rounds (default 5; some have fewer)")
    parser.add_argument("--write", type=Path, metavar="DIR", help="write performance.md, its figures and JSON there")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the measurements there")
    parser.add_argument("--short", action="store_true", help="as little as a test needs: its numbers mean nothing")
    given = parser.parse_args(arguments)
    if unknown := [name for name in given.parts if name not in PARTS]:
        parser.error(f'part "{unknown[0]}": there is no such part; choose from {", ".join(PARTS)}')
    extent = SHORT if given.short else Extent(rounds=max(1, given.repeat))
    measured = read_parts(given.write) if given.write else {}
    for name in given.parts or PARTS:
        say(name)
        measured[name] = measure_in_turns(PARTS[name].measures(extent), extent.rounds)
    measured = {name: measured[name] for name in PARTS if name in measured}
    print(text_of(measured))
    if given.json:
        given.json.write_bytes(msgspec.json.encode(measured))
    if given.write:
        print(write_page(measured, given.write, {name: part.text for name, part in PARTS.items()}))
    return 0


if __name__ == "__main__":
    sys.exit(main())
