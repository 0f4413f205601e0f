"""The limits of a soak, and whether a run kept them. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Literal, NamedTuple

import numpy as np
import pandas as pd

from gridpeers.scenarios.checks.check_verdict import CheckVerdict, Violation, summary

FLAT = 0.05
"""Growth of memory or files, as a part, that counts as flat."""

HEAL = 6.0
"""Longest time (s) from the end of a cut until both sides use each other's new values."""

LATE, BUSY = 1e-3, 0.1
"""Part of the plant's steps that may be late, and of the machine beyond which other programs explain more."""

WARM = 0.2
"""Part of a run after which memory is compared: caches are full, and every agent was replaced."""

SPAN = 0.15
"""Part of a run over which sizes are averaged, after the warm-up and at the end."""

LEAST = 300.0
"""Shortest run (s) whose growth says anything."""

LAST_WORDS = "last_words"
"""The check that names agents that end without a reason in the record."""

FREQUENCY = "frequency"
"""The check of the band of frequency."""

SETTLED = 2.0
"""Time (s) after which the check of frequency judges after an event."""

NOTICED = 2.0
"""Longest time (s) between a kill and an agent's last state, as the observer's run time is a message old."""

YOUNG = (10.0, 20.0)
"""Ages (s) at which agents that were started early and late are compared."""

STARTS = 6
"""Starts of agents that a comparison by age needs."""

Verdict = Literal["PASS", "FAIL", "-"]


class ProcessSize(NamedTuple):
    """Size of a process at one time."""

    at: float
    """When (s, monotonic)."""
    name: str
    """Agent, "plant" or "command"."""
    pid: int
    """Process id."""
    born: float
    """When it was started (s, monotonic)."""
    memory: float
    """Anonymous resident memory (MB)."""
    files: int
    """Open files, sockets among them."""

    @property
    def age(self) -> float:
        """Time since its start (s)."""
        return self.at - self.born


class Finding(NamedTuple):
    """One row of the result."""

    what: str
    limit: str
    """In words; empty where a number is told only."""
    found: str
    verdict: Verdict
    """"-": not judged."""


class Growth(NamedTuple):
    """Size of something after the warm-up and at the end."""

    name: str
    before: float
    after: float

    @property
    def part(self) -> float:
        """Growth as a part: 0.05 from 40 to 42."""
        return round(self.after / self.before - 1.0, 6)


def growths(sizes: Sequence[ProcessSize], of: Literal["memory", "files"], stays: Iterable[str]) -> list[Growth]:
    """Return the growth of each process that stays, of young agents, and of all processes together.

    Sizes are in the order of time, and one look at all processes has one time; `stays` run all the time.
    """
    if not sizes:
        return []
    all_of = pd.DataFrame(sizes, columns=ProcessSize._fields)
    begin, length = all_of["at"].iloc[0], all_of["at"].iloc[-1] - all_of["at"].iloc[0]
    age = all_of["at"] - all_of["born"]

    def between(part: pd.Series[float]) -> tuple[float, float]:
        """Return the medians after the warm-up and at the end of a size by time."""
        share = (part.index.to_numpy() - begin) / length
        warm, last = part[(share >= WARM) & (share <= WARM + SPAN)], part[share >= 1.0 - SPAN]
        return float(warm.median()), float(last.median())

    found = [Growth(name, *between(all_of[all_of["name"] == name].set_index("at")[of])) for name in stays]
    young = all_of[age.between(*YOUNG) & (all_of["born"] > begin)].groupby(["born", "pid"])[of].first()
    if len(young) >= STARTS:
        middle = len(young) // 2
        found.append(Growth("agents of the same age", young.iloc[:middle].median(), young.iloc[middle:].median()))
    looks = all_of.groupby("at")[of].agg(["sum", "size"])
    return [*found, Growth("all together", *between(looks["sum"][looks["size"] == looks["size"].mode()[0]]))]


def judge_growth(what: str, found: Sequence[Growth], seconds: float) -> Finding:
    """Return whether something stayed flat over a run of some length (s)."""
    known = [one for one in found if one.part == one.part]
    if not known:
        return Finding(what, f"flat within {100 * FLAT:g} %", "too short a run", "-")
    worst = max(known, key=lambda one: one.part)
    whole = next((one for one in known if one.name == "all together"), worst)
    text = f"at most {100 * worst.part:+.1f} % ({worst.name}: {worst.before:.1f} to {worst.after:.1f})"
    if worst is not whole:
        text += f"; all together {100 * whole.part:+.1f} % ({whole.before:.1f} to {whole.after:.1f})"
    verdict: Verdict = "-" if seconds < LEAST else "PASS" if worst.part <= FLAT else "FAIL"
    return Finding(what, f"flat within {100 * FLAT:g} %", text, verdict)


def judge_late(late: int, steps: int, others: float) -> Finding:
    """Return whether few steps were late; others is the part of the machine that other programs took meanwhile.

    Examples
    --------
    >>> judge_late(200, 1000, 0.01)
    Finding(what='late steps', limit='at most 0.1 %', found='200 of 1000; other programs 1 %', verdict='FAIL')
    """
    verdict: Verdict = "PASS" if late <= LATE * steps else "-" if others > BUSY else "FAIL"
    return Finding(
        "late steps", f"at most {100 * LATE:g} %", f"{late} of {steps}; other programs {100.0 * others:.0f} %", verdict
    )


def judge_times(what: str, seconds: Sequence[float], limit: float | None, deaf: int = 0) -> Finding:
    """Return whether times (s) are below a limit (s); those in which this program was deaf are left out.

    Examples
    --------
    >>> judge_times("heal", [0.1, 0.2, 0.3], 6.0)
    Finding(what='heal', limit='under 6 s', found='3: p50 0.20, p95 0.29, worst 0.30 s', verdict='PASS')
    """
    words = "" if limit is None else f"under {limit:g} s"
    left_out = f"; {deaf} not counted, as this program lost its session" if deaf else ""
    if not seconds:
        return Finding(what, words, f"none{left_out}", "-")
    worst = max(seconds)
    finite = [s for s in seconds if s < float("inf")]
    p50, p95 = (float(np.percentile(finite, q)) for q in (50, 95)) if finite else (worst, worst)
    never = len(seconds) - len(finite)
    shown = f"{worst:.2f} s" if not never else f"never ({never})"
    text = f"{len(seconds)}: p50 {p50:.2f}, p95 {p95:.2f}, worst {shown}{left_out}"
    return Finding(what, words, text, "-" if limit is None else "PASS" if worst < limit else "FAIL")


def judge_checks(
    verdicts: tuple[CheckVerdict, ...],
    silences: Sequence[Violation],
    kills: Sequence[tuple[str, float]],
    heals: Sequence[float] = (),
) -> Finding:
    """Return the verdict of the checks of a run.

    `silences` are all that the check of last words names; its verdict shows some of them. It names each of the `kills`
    (agent and run time), as nothing in the run tells why they are silent, and no others. `heals` are run times (s) at
    which agents that were parted used each other again: what they held meanwhile is old, so the frequency moves; its
    check knows changes of switches, loads and inverters alone, and may name it then.
    """
    if not verdicts:
        return Finding("checks", "none fails", "there is no checks.json", "FAIL")
    known: dict[str, str] = {}
    for one in verdicts:
        if one.status != "failed":
            continue
        if one.check == LAST_WORDS and one.count == len(silences) and _were_killed(silences, kills):
            known[one.check] = f"{LAST_WORDS} names the {len(kills)} kills by agent and time, and nothing else"
        if one.check == FREQUENCY and one.count == len(one.violations) and _follow(one.violations, heals):
            worst = max(it.value or 0.0 for it in one.violations)
            known[one.check] = f"{FREQUENCY} names {one.count} x up to {worst:.4f} Hz within {SETTLED:g} s of a heal"
    rest = tuple(one for one in verdicts if one.check not in known)
    failed = any(one.status == "failed" for one in rest)
    return Finding("checks", "none fails", "; ".join((summary(rest), *known.values())), "FAIL" if failed else "PASS")


def _follow(violations: Sequence[Violation], heals: Sequence[float]) -> bool:
    """Return whether each violation comes with a heal, or up to `SETTLED` after it."""
    return all(one.t is not None and any(-NOTICED <= one.t - heal <= SETTLED for heal in heals) for one in violations)


def _were_killed(silences: Sequence[Violation], kills: Sequence[tuple[str, float]]) -> bool:
    """Return whether each agent that fell silent was killed then, and each kill has its silence.

    Kills of one agent are seconds apart: in the order of time the first silence belongs to the first kill.
    """
    silent = sorted((one.agent, -1.0 if one.t is None else one.t) for one in silences)
    return len(silent) == len(kills) and all(
        name == killed and abs(t - when) <= NOTICED
        for (name, t), (killed, when) in zip(silent, sorted(kills), strict=True)
    )
