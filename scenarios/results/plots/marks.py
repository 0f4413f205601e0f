"""Marks of events in a figure: a fine line each, and above the frame the event's label and what happens in it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import accumulate
from math import inf
from types import MappingProxyType
from typing import Any, Literal, NamedTuple

from matplotlib.axes import Axes
from numpy.typing import NDArray

from gridpeers.scenarios.results.plots.drawing import Drawing, Mark
from gridpeers.scenarios.results.plots.style import time_axis

Panels = NDArray[Any]

TextSide = Literal["left", "center", "right"]  # Which part of a text stands at the line

BLACK, GREY = "#000000", "#444444"
"""Colours of lines and words."""

LETTER = 0.056  # Width of a letter of these texts (inches), a little more than the mean of DejaVu Sans at 7 pt
LONGEST = 20  # Letters of a word that is written whole
GAP = 0.06  # Least distance between two texts (inches)
ROUNDING = 1e-9  # By how much less (inches) is no less: an edge at GAP from a text may come out so by the last bit
MOST = 12.0  # Lines in an inch of a frame that leave its curves to be seen
FRAME = 0.78  # Part of a column of panels that is the frame of one; the rest are its axis and margins


_SIDES: tuple[tuple[TextSide, float, float], ...] = (("center", 0.5, 0.0), ("left", 0.0, 1.0), ("right", 1.0, 1.0))
"""Sides, with the part of a text that stands before its line, and their price."""


class EventText(NamedTuple):
    text: str
    mark: Mark
    side: TextSide


def mark_events(
    axes: Axes, drawing: Drawing, *, labelled: bool, colours: Mapping[Mark, str] = MappingProxyType({})
) -> None:
    """Draw a fine line at each event; if labelled, say above the frame what happens, as far as there is room.

    Of so many events that lines would hide the curves, only those have one for whose words there is room.
    """
    width = _width(axes)
    end = max(float(history.t[-1]) for history in drawing.histories.values())
    texts = place_texts(drawing.events, width / max(end, 1e-9))
    crowded = len(drawing.events) > MOST * width
    for mark in (one.mark for one in texts) if crowded else drawing.events:
        axes.axvline(mark.t, color=colours.get(mark, BLACK), linewidth=0.7, linestyle=(0, (1, 2)), zorder=1)
    lines = 0
    if labelled:
        for text, mark, side in texts:
            colour = colours.get(mark, BLACK)
            note_above(axes, text, mark.t, "data", side, colour=GREY if colour == BLACK else colour)
            lines = max(lines, text.count("\n") + 1)
    axes.set_title(axes.get_title(loc="left"), loc="left", pad=5.0 + 9.0 * lines)


def finish(grid: Panels, drawing: Drawing) -> None:
    """Give panels their axis of time and the marks of events: words above the top row, "time" below the bottom row."""
    for row, panels in enumerate(grid):
        for panel in panels:
            time_axis(panel, drawing)
            mark_events(panel, drawing, labelled=row == 0)
            if row < len(grid) - 1:
                panel.set_xlabel("")


def place_texts(marks: Sequence[Mark], inches_per_s: float) -> list[EventText]:
    r"""Place texts so that none covers another: beside its line where need be, shorter, and at last left out.

    Examples
    --------
    >>> found = place_texts([Mark("event1", 1.0, "13-152 opens"), Mark("leave", 1.1)], inches_per_s=1.0)
    >>> [(text, side) for text, _, side in found]
    [('event1\n13-152 opens', 'right'), ('leave', 'left')]
    """
    options = [_options(mark, inches_per_s) for mark in sorted(marks, key=lambda mark: mark.t)]
    first = [*accumulate((min(one.start for one in each) for each in reversed(options)), min)][::-1]
    best: dict[float, tuple[float, tuple[EventText, ...]]] = {-inf: (0.0, ())}
    """Cost and texts by the right edge (inches): those that no other beats in both edge and cost, sorted by edge."""
    for each, leftmost in zip(options, first, strict=True):
        found: dict[float, tuple[float, tuple[EventText, ...]]] = {}
        for right, (cost, texts) in best.items():
            edge = max(right, leftmost - GAP)  # nothing stands further left any more, so these are alike
            for option in each:
                if option.start >= edge + GAP - ROUNDING:
                    end, total = max(edge, option.end), cost + option.price
                    if end not in found or total < found[end][0]:
                        found[end] = total, (*texts, *option.texts)
        best, least = {}, inf
        for end, (cost, texts) in sorted(found.items()):
            if cost < least:
                best[end], least = (cost, texts), cost
    return list([*best.values()][-1][1])


class _Option(NamedTuple):
    """One way to write at a mark, or to leave it out; its edges (inches) are infinite then."""

    price: float
    texts: tuple[EventText, ...] = ()
    start: float = inf
    end: float = -inf


def _options(mark: Mark, inches_per_s: float) -> list[_Option]:
    what = " ".join(map(_abridged, mark.what.split(" ")))
    both = "\n".join(text for text in (mark.label, what) if text)
    narrow = "\n".join(text for text in (mark.label, what.replace(" ", "\n", 1)) if text)
    prices = {mark.label: 10.0, narrow: 5.0} | {both: 0.0}  # of equal texts the last, cheapest price counts
    found = [_Option(30.0 if both else 0.0)]
    for text, price in prices.items():
        width = LETTER * max(map(len, text.split("\n")))
        for side, before, more in _SIDES:
            start = mark.t * inches_per_s - before * width
            if text:
                found.append(_Option(price + more, (EventText(text, mark, side),), start, start + width))
    return found


def _abridged(word: str) -> str:
    """Return a word without its middle if it is long, as names of switches in other programs' feeders are.

    Examples
    --------
    >>> _abridged("mdv201_hn_2_793_abc1023346_sw"), _abridged("13-152")
    ('mdv201_hn...23346_sw', '13-152')
    """
    return word if len(word) <= LONGEST else f"{word[:9]}...{word[-8:]}"


def note_above(axes: Axes, text: str, x: float, of: str, side: TextSide, *, colour: str = GREY) -> None:
    """Write small words above the frame, at x of the data or of the frame."""
    axes.annotate(
        text,
        (x, 1.0),
        xycoords=(of, "axes fraction"),
        xytext=(0, 2),
        textcoords="offset points",
        ha=side,
        fontsize=7,
        color=colour,
    )


def _width(axes: Axes) -> float:
    """Return roughly how wide (inches) a panel will be: the layout is made when the figure is drawn."""
    place, figure = axes.get_subplotspec(), axes.get_figure(root=True)
    assert figure is not None
    columns = 1 if place is None else place.get_gridspec().ncols
    return float(figure.get_size_inches()[0]) / columns * FRAME
