"""Figures: that they are made, that a case looks the same in all of them, that nothing warns."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from gridpeers.plant.tables import read_feeder
from gridpeers.scenarios.results.history import History, Nameplates
from gridpeers.scenarios.results.island_membership import IslandInterval, RecordedIsland
from gridpeers.scenarios.results.plots.drawing import Drawing, Mark
from gridpeers.scenarios.results.plots.run_figures import draw, draw_all
from gridpeers.scenarios.results.plots.style import GAP, LETTER, STYLES, Format, event_texts, save


def drawing(*cases: str) -> Drawing:
    nameplates = Nameplates.of(read_feeder("microgrid123").inverters)
    t = np.arange(0.0, 7.01, 0.05)
    level = np.where(t > 1.0, 0.87, 0.65)[:, None] * np.ones(9)
    histories = {
        case: History(
            inverters=nameplates.names,
            t=t,
            f=np.full((t.size, 9), 60.0 - 0.01 * number),
            P=level * nameplates.s * (1 + 0.01 * np.arange(9)),
            Q=0.1 * nameplates.s * np.ones((t.size, 9)),
            V=nameplates.V_nom * np.ones((t.size, 9)),
            P_set=0.65 * nameplates.s * np.ones((t.size, 9)),
            V_set=nameplates.V_nom * np.ones((t.size, 9)),
        )
        for number, case in enumerate(cases)
    }
    return Drawing(
        histories=histories,
        titles=dict.fromkeys(cases, "made up"),
        nameplates=nameplates,
        events=[Mark("event1", 1.0, "13-152 opens"), Mark("event2", 4.0, "60-160 opens")],
        f_nom=60.0,
    )


def test_every_figure_of_the_paper_is_drawn(tmp_path: Path) -> None:
    """One file per figure, whole and readable, with as many cases as were run."""
    files = draw_all(drawing("ring", "path", "star"), tmp_path)

    assert {path.name for path in files} == {path.name for path in tmp_path.iterdir()}
    assert {path.stem for path in files} == {"overview", "power_GFM", "power_GFL"}
    for path in files:
        pixels = imread(path)
        assert pixels.shape[0] > 300
        assert pixels.std() > 0.01


def test_no_curve_hides_another_that_it_lies_upon() -> None:
    """Where all cases coincide, each is seen: every later curve is narrower than those below it."""
    cases = list("abcdefgh")
    for axes in draw(drawing(*cases), "overview").axes:
        drawn = [line for line in axes.get_lines() if line.get_label().split(":")[0] in cases]
        for below, above in pairwise(drawn):
            assert above.get_linewidth() <= below.get_linewidth() - 0.2
            assert above.get_color() != below.get_color()
    signs = [
        line.get_markevery() for line in draw(drawing("a"), "power_GFL").axes[0].get_lines() if line.get_markevery()
    ]
    assert len({start for start, _ in signs}) > 1, "inverters that coincide have their markers at different times"


def test_a_case_has_one_colour_everywhere_and_no_two_share_it() -> None:
    """A reader who knows a case in one panel knows it in all."""
    page = draw(drawing("IV", "II"), "overview")

    for axes in page.axes:
        colours = {line.get_label(): line.get_color() for line in axes.get_lines() if " " in str(line.get_label())}
        assert colours == {"IV: made up": STYLES[0][0], "II: made up": STYLES[1][0]}
    assert len({colour for colour, _ in STYLES}) == 6


def test_labels_beside_wide_ticks_are_within_the_figure(tmp_path: Path) -> None:
    """The layout has the ticks of the file: the borders stay blank."""
    made_up = drawing("I", "IV")
    history = made_up.histories["I"]
    late = (history.t > 1.0)[:, None]  # ticks like 59.75 and 0.025
    wide = replace(history, f=history.f - 0.25 * late, V=history.V * (1.0 + 0.03 * late))
    page = draw(replace(made_up, histories=made_up.histories | {"I": wide}), "overview")
    pixels = imread(*save(page, tmp_path, "overview"))[:, :, :3]

    for border in (pixels[:, :3], pixels[:, -3:], pixels[:3], pixels[-3:]):
        assert border.min() == 1.0


@pytest.mark.parametrize("kind", ["pdf", "svg"])
def test_a_figure_has_the_same_bytes_each_time_it_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: Format
) -> None:
    """No date, no random name: a folder of figures can be compared byte by byte."""
    (first,) = save(draw(drawing("I", "IV"), "overview"), tmp_path / "first", "overview", [kind])
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1")  # what matplotlib takes for the time of writing, if it writes one
    (second,) = save(draw(drawing("I", "IV"), "overview"), tmp_path / "second", "overview", [kind])

    assert first.read_bytes() == second.read_bytes()
    assert [path.name for path in first.parent.iterdir()] == [f"overview.{kind}"]


def test_every_axis_says_its_quantity_and_events_are_marked() -> None:
    """Frequencies are in Hz, voltages in pu, time in s; both events have their line, their label, and what happens."""
    page = draw(drawing("I"), "overview")

    assert [axes.get_ylabel() for axes in page.axes] == [
        "mean of the GFM, f (Hz)",
        "MPSI",
        "mean of abs(V - 1) (pu)",
        "MQSI",
    ]
    assert [axes.get_xlabel() for axes in page.axes] == ["", "", "time (s)", "time (s)"]
    above = {text.get_text() for text in page.axes[0].texts}
    assert above == {"event1\n13-152 opens", "event2\n60-160 opens"}


@pytest.mark.parametrize("inches_per_s", [0.05, 0.6, 2.0])
def test_words_on_events_never_cover_each_other(inches_per_s: float) -> None:
    """However near events are: first what happens is left out, and at last the label too."""
    marks = [
        Mark("islanding", 1.0, "13-152 opens"),
        Mark("leave", 2.0, "inv2 leaves"),
        Mark("return", 3.0, "inv2 joins"),
        Mark("", 3.2),
        Mark("live", 3.3, "sw1_2 opens"),
    ]
    found = event_texts(marks, inches_per_s)
    starts = {mark: mark.t * inches_per_s for mark in found}
    ends = {mark: starts[mark] + LETTER * max(map(len, text.split("\n"))) for mark, text in found.items()}

    assert all(starts[after] >= ends[before] + GAP - 1e-9 for before, after in pairwise(found))
    assert found
    assert inches_per_s < 2.0 or len(found) >= 3


def test_a_thousand_events_leave_the_curves_to_be_seen() -> None:
    """An hour in which people change something all the time: only events with words have a line, and all are placed."""
    it = drawing("IV")
    end = float(it.histories["IV"].t[-1])
    few = replace(it, events=[Mark("leave", end / 3, "inv2 leaves"), Mark("", end / 2)])
    many = replace(it, events=[Mark("live", end * i / 1000, f"inv{i % 10} leaves") for i in range(1000)])

    def lines_and_words(of: Drawing) -> tuple[int, int]:
        panel = draw(of, "overview").axes[0]
        return sum(len(line.get_xdata()) == 2 for line in panel.get_lines()), len(panel.texts)

    nominal = 1
    assert lines_and_words(few) == (2 + nominal, 1)
    lines, words = lines_and_words(many)
    assert 3 <= words == lines - nominal < 40


def test_where_there_are_islands_the_worst_is_drawn() -> None:
    """Their mean hides what is wrong: here one is 0.03 Hz too fast, and the other two 0.015 Hz too slow."""
    it = drawing("IV")
    islands = {f"inv{i}": RecordedIsland((f"inv{i}", f"inv{i + 1}", f"inv{i + 2}"), False) for i in (1, 4, 7)}
    history = it.histories["IV"]
    history.f[history.t > 4.0] = 60.0 + np.repeat([-0.015, 0.03, -0.015], 3)
    page = draw(replace(it, island_intervals={"IV": [IslandInterval(4.0, 7.0, islands)]}), "overview")

    line = next(line for line in page.axes[0].get_lines() if line.get_label() == "IV: made up")
    drawn = np.asarray(line.get_ydata())
    assert drawn[history.t <= 4.0] == pytest.approx(60.0)
    assert drawn[history.t > 4.0] == pytest.approx(60.03)
    assert all(axes.get_title(loc="left").endswith(", worst island") for axes in page.axes)


def test_an_island_without_load_draws_no_dust() -> None:
    """Its sharing index divides next to nothing by next to nothing: no curve there, and the axis stays readable."""
    it = drawing("IV")
    history = it.histories["IV"]
    history.P[history.t > 4.0] = 1e-6 * np.array([1, -1, 1, -1, 1, -1, 1, -1, 0.001])
    history.Q[history.t > 4.0] *= np.array([1, 100, -98, 1, 100, -98, 1, 1, 1])
    page = draw(it, "overview")

    line = next(line for line in page.axes[1].get_lines() if line.get_label() == "IV: made up")
    drawn = np.asarray(line.get_ydata())
    assert np.isnan(drawn[history.t > 4.0]).all()
    assert np.isfinite(drawn[history.t <= 4.0]).all()
    assert page.axes[3].get_ylim()[1] == 5.0
