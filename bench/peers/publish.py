"""The stored measurements and their page together: order of the parts, one more part, the page anew."""

from __future__ import annotations

from pathlib import Path

from bench.peers.long_parts import LONG_RUNS, long_part
from bench.peers.measured import PartRun
from bench.peers.page import write_page
from bench.peers.parts import PARTS
from bench.peers.stored import DATA_FILE, Parts, read_parts, save_parts

DOCS = Path(__file__).parents[2] / "docs"


def in_order(parts: Parts) -> dict[str, PartRun]:
    """Return the parts in the order of the page; one that the bench does not have any more is left out."""
    return {name: parts[name] for name in (*PARTS, *map(long_part, LONG_RUNS)) if name in parts}


def keep(name: str, run: PartRun, *files: Path) -> None:
    """Store a part in some files beside the other parts there."""
    for file in files:
        save_parts(in_order(read_parts(file) | {name: run}), file)


def publish(folder: Path) -> Path:
    """Write the page of a folder from the measurements that are stored there."""
    return write_page(in_order(read_parts(folder / DATA_FILE)), folder, list(PARTS))
