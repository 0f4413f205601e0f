"""Disturb runs in real time and print what came of it: ``python -m tests.resources [WORD ...]``.

Without words all disturbances of `tests.resources.disturbances` are tried, else those whose names have one of them.
"""

from __future__ import annotations

import os
import sys

from tests.resources.disturbances import TRIALS, SkippedError

HEAD = (
    "| disturbance | rows | steps late, worst (ms) | largest deviation meanwhile, after (Hz) | rejected "
    "| memory: largest peak (MB), growth | log (kB) |"
)


def main() -> None:
    """Try and print a row for each."""
    words = sys.argv[1:]
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f} before\n{HEAD}\n|{'---|' * 7}", flush=True)
    for name, trial in TRIALS.items():
        if words and not any(word in name for word in words):
            continue
        try:
            found, note = trial()
        except SkippedError as error:
            print(f"    {name}: {error}", file=sys.stderr, flush=True)
            continue
        kinds = f" ({', '.join(found.kinds)})" if found.kinds else ""
        late = f"{found.late}, {1e3 * found.worst_step:.0f}" + (
            f", put off {found.slipped:.2f} s" if found.slipped else ""
        )
        print(
            f"| {name}{f': {note}' if note else ''} | {found.rows} | {late} | {found.df:.4f}, {found.df_after:.4f} | "
            f"{found.rejected}{kinds} | {found.peak:.0f}, {found.growth:.2f} | {found.log / 1e3:.1f} |",
            flush=True,
        )
        for said in found.said[:3]:
            print(f"    {said}", file=sys.stderr, flush=True)
    print(f"load {os.getloadavg()[0]:.1f} after")


if __name__ == "__main__":
    main()
