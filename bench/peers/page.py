"""The page docs/performance.md with its figures, from the stored measurements alone."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from bench.peers import prose, rows
from bench.peers.criteria import CRITERIA, HEAD
from bench.peers.figures import draw_figures, drawn, link
from bench.peers.stored import Parts
from scenarios.duration import duration
from scenarios.results.run_files import write_whole

PAGE_FILE = "performance.md"

QUIET = 0.1
"""Part of the processors that other programs may take on a machine that counts as idle."""


def write_page(parts: Parts, folder: Path, names: Sequence[str]) -> Path:
    """Write the page and its figures into a folder, and return the page.

    Parameters
    ----------
    parts
        The measurements.
    folder
        Where to.
    names
        The parts of `bench.peers`, in their order.
    """
    draw_figures(parts, folder)
    page = folder / PAGE_FILE
    write_whole(page, page_text(parts, names))
    return page


def page_text(parts: Parts, names: Sequence[str]) -> str:
    """Return the page: it follows from the measurements and from the prose alone."""
    took = sum(parts[name].seconds for name in names if name in parts)
    whole = all(name in parts for name in names)
    minutes = f"{duration(round(took))} when this page was measured" if whole else "a quarter of an hour"
    sections = [
        prose.INTRODUCTION.format(names=", ".join(f"`{name}`" for name in names), minutes=minutes),
        *_warning(parts),
        "## Ours beside its peers\n\n" + _table(rows.COMPARISON_HEAD, rows.comparison(parts)),
        prose.ALONE,
        _table(("what", "ours", "rounds, least to largest"), rows.alone(parts)),
        prose.CRITERIA,
        how_far(parts),
        _table(HEAD, (criterion.row(parts) for criterion in CRITERIA)),
        "## Cost against the number of agents and of links",
        *(link(name) for name in ("agents", "links") if drawn(parts, name)),
        prose.LINKS,
    ]
    if shares := list(rows.shares(parts)):
        sections.append("## Parts of a case in one process\n\n" + _table(("part", "ms", "%"), shares))
    sections += [
        prose.LIMITS,
        prose.SCALE,
        _table(rows.SCALE_HEAD, rows.scale(parts)),
        *([link("scale")] if drawn(parts, "scale") else ()),
        prose.SCALE_NOTES,
        prose.LONG_RUNS,
        _table(rows.LONG_HEAD, rows.long_runs(parts)),
        prose.LONG_NOTES,
        "## The machine\n\n" + "\n".join(rows.machines(parts)),
    ]
    return "\n\n".join(section.rstrip("\n") for section in sections) + "\n"


def how_far(parts: Parts) -> str:
    """Return how many of the numbers that are asked for are met, and how far the others are."""
    verdicts = [criterion.verdict(parts) for criterion in CRITERIA]
    met, missed = verdicts.count("met"), verdicts.count("missed")
    away = ""
    if missed:
        missing = [criterion for criterion, verdict in zip(CRITERIA, verdicts, strict=True) if verdict == "missed"]
        factors = [criterion.away(parts) for criterion in missing]
        away = f", by a factor of {min(factors):.2f} to {max(factors):.2f}"
    absent = len(CRITERIA) - met - missed
    return f"Of {len(CRITERIA)} numbers {met} are met, {missed} are missed{away}, and {absent} are not measured."


def tables_text(parts: Parts) -> str:
    """Return the tables for a terminal."""
    lines = [f"{'':68}{'theirs':>11}{'ours':>11}{'ratio':>8}  rounds"]
    lines += [f"{text:68}{them:>11}{us:>11}{by:>8}  {found}" for text, them, us, by, found in rows.comparison(parts)]
    lines += ["", *(f"{text:79}{us:>11}{'':8}  {found}" for text, us, found in rows.alone(parts)), ""]
    for criterion in CRITERIA:
        text, limit, measured, _, found, verdict, _ = criterion.row(parts)
        lines.append(f"{text:79}{measured:>11}  {limit:18}  {verdict}{f', {found}' if measured else ''}")
    return "\n".join([*lines, how_far(parts), "", *rows.machines(parts)])


def _warning(parts: Parts) -> Iterator[str]:
    """Yield a paragraph where other programs had a share of the machine that spoils the numbers."""
    busy = {name: part.others for name, part in parts.items() if part.others > QUIET}
    if busy:
        named = ", ".join(f"`{name}` {100 * others:.0f} %" for name, others in busy.items())
        yield (
            f"**Some of these numbers are of a busy machine**: other programs took of its processors, during {named}. "
            "They show the order of things; run these parts on an idle machine for the verdicts."
        )


def _table(head: Sequence[str], lines: Iterable[Sequence[str]]) -> str:
    cells = (head, ("---",) * len(head), *lines)
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in cells)
