"""How often the self-check of emulated links warns of a sound run: it promises one run in a thousand, at most.

Runs of netem alone, each with a seed of its own: one link of every model and profile at several lengths, and 72 links
of one profile. A run's first warning comes at the level `family`, so lower promises are counted on the same runs.

    .venv/bin/python bench/selfcheck.py [--runs 200] [--whole 200] [--profile lte]
"""

from __future__ import annotations

import argparse
import sys
from time import monotonic

import numpy as np
from scipy import stats

from tests.netem.runs import ALL, all_links, family, sound

LEVELS = (0.001, 0.01, 0.1)
"""Of which the share of runs is counted that fall below."""

LENGTHS = (20, 60, 200, 450, 1000, 5000)
"""Messages a link. Shorter runs are cheaper, and more of them are taken."""


def line(what: str, levels: np.ndarray) -> str:
    """Shares below each level, and how likely so many are if the promise holds."""
    counts = [int((levels <= level).sum()) for level in LEVELS]
    chance = min(
        float(stats.binomtest(count, len(levels), level, "greater").pvalue)
        for count, level in zip(counts, LEVELS, strict=True)
    )
    shares = " ".join(f"{100.0 * count / len(levels):8.3f}" for count in counts)
    return f"{what:34}{len(levels):7} {shares}   {chance:.2g}"


def main() -> int:
    """Run and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--runs", type=int, default=200, help="runs of each kind at 450 messages")
    parser.add_argument("--whole", type=int, default=200, help="runs of 72 links")
    parser.add_argument("--profile", default="lte", help="of the runs of 72 links")
    parser.add_argument("--seed", type=int, default=0, help="first seed")
    arguments = parser.parse_args()
    began, seed, everything = monotonic(), arguments.seed, []
    print(f"{'sound runs (%) below':34}{'runs':>7} {' '.join(f'{level:8g}' for level in LEVELS)}   p of the worst")
    for kind, done in ALL.items():
        levels = []
        for n in LENGTHS:
            runs = max(1, round(arguments.runs * 450 / max(n, 50)))
            levels += [family(sound(done, n, seed + i)) for i in range(runs)]
            seed += runs
        print(line(kind, np.array(levels)), flush=True)
        everything += levels
    print(line("all", np.array(everything)), flush=True)
    links = all_links()
    whole = [family(sound(ALL[arguments.profile], 450, seed + i, links)) for i in range(arguments.whole)]
    if whole:
        print(line(f"{arguments.profile}, 72 links, 450 messages", np.array(whole)))
    print(f"{monotonic() - began:.0f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
