"""The page docs/performance.md: it says what the stored measurements say, and why a row has no number."""

from pathlib import Path

import pytest

from bench.peers import our_case, page, rows
from bench.peers.criteria import CRITERIA, Criterion
from bench.peers.measured import PartRun
from bench.peers.parts import PARTS, Extent
from bench.peers.publish import DOCS, in_order
from bench.peers.quantity import Flatness, Quantity
from bench.peers.stored import DATA_FILE, read_parts, save_parts
from tests.peers.made_up import part_of

BY_TEXT = {criterion.text: criterion for criterion in CRITERIA}


def test_the_page_in_docs_is_the_one_that_the_stored_measurements_give() -> None:
    """Nobody types a number into the page: `python -m bench.peers --page` writes it from performance.json."""
    parts = in_order(read_parts(DOCS / DATA_FILE))

    assert (DOCS / page.PAGE_FILE).read_text(encoding="utf-8") == page.page_text(parts, list(PARTS))


def test_a_number_that_is_asked_for_is_met_missed_or_says_why_it_is_not_there() -> None:
    """The verdict follows from the median; a limit itself is met."""
    parts = {"tick": part_of(ours__tick__9=[1.0, 1.6, 9.0], zenoh__tick__9=[1.0, 1.0, 1.0])}
    parts["tick"].missing["helics-zmq.tick.9"] = "HELICS zmq: no broker"

    found = {text: criterion.verdict(parts) for text, criterion in BY_TEXT.items()}

    assert found["tick, a process for each agent: ours / bare Zenoh"] == "met"
    assert found["tick, a process for each agent: HELICS zmq, empty / ours"] == "not measured: HELICS zmq: no broker"
    assert found["plant: GridLAB-D / ours"] == "not measured yet: `python -m bench.peers plant`"
    assert found["long run `live`: growth of memory"] == "not measured yet: `python -m bench.long_runs live`"
    assert Criterion("x", Quantity("tick", ("ours.tick.9",)), 3.0, at_least=True).verdict(parts) == "missed"


def test_a_criterion_shows_its_limit_number_rounds_and_load() -> None:
    """A reader sees from one row how far the number is, how much it varies, and on what machine."""
    parts = {"tick": part_of(ours__tick__3=[0.001, 0.0006, 0.002])}

    assert BY_TEXT["tick, three agents a process"].row(parts) == (
        *("tick, three agents a process", "at most 1.2 ms", "1 ms", "0.83", "0.6 to 2 (3)", "met"),
        "0.1 to 0.2, others 0 %",
    )


def test_the_page_says_how_many_numbers_are_met_and_how_far_the_others_are() -> None:
    """A reader sees how far we are before the rows; a number that must be large is away from below."""
    parts = {"tick": part_of(ours__tick__9=[0.002], zenoh__tick__9=[0.001])}
    parts["tick"].values |= {"helics-zmq.tick.9": [0.005], "ours.tick.3": [0.0009]}

    assert page.how_far(parts) == (
        f"Of {len(CRITERIA)} numbers 2 are met, 2 are missed, by a factor of 1.20 to 1.25, "
        f"and {len(CRITERIA) - 4} are not measured."
    )


def test_a_ratio_is_the_median_of_the_rounds() -> None:
    """A machine that becomes slower slows both rivals of a round, so that ratios are of one round."""
    parts = {"tick": part_of(a=[1.0, 20.0, 3.0], b=[1.0, 10.0, 1.0])}

    ratio = Quantity("tick", ("a",), ("b",))

    assert ratio.rounds(parts) == [1.0, 2.0, 3.0]
    assert ratio.value(parts) == 2.0


def test_a_cost_is_flat_where_the_dearest_size_costs_what_the_cheapest_does() -> None:
    """A size that is cheaper than nine agents counts as much as one that is dearer."""
    parts = {"links": part_of(x9=[2.0, 2.0, 8.0], x30=[1.0, 1.0, 1.0])}

    flatness = Flatness("links", ("x9", "x30"))

    assert flatness.value(parts) == 2.0
    assert flatness.rounds(parts) == [2.0, 2.0, 8.0]
    assert (
        Flatness("links", ("x9", "x99")).missing(parts) == "not measured: not part of the run of 2026-01-01 00:00 UTC"
    )


def test_every_number_of_the_page_is_one_that_a_measure_gives(monkeypatch: pytest.MonkeyPatch) -> None:
    """A row whose value no measure names would be empty for ever, and could not say why."""
    monkeypatch.setattr(our_case.OurCase, "sizes", (200, 100))
    for name in ("plant_alone", "in_process", "with_processes"):
        monkeypatch.setattr(our_case.OurCase, name, lambda self: {})
    given = {
        (name, value) for name, part in PARTS.items() for measure in part.measures(Extent()) for value in measure.values
    }
    numbers = [criterion.number for criterion in CRITERIA] + [quantity for _, quantity in rows.ALONE]

    wanted = {
        (number.part, value)
        for number in numbers
        for value in (*number.names, *getattr(number, "over", ()))
        if not number.part.startswith("long-")
    }

    assert wanted <= given


def test_the_page_has_every_rival_its_ratio_and_who_was_left_out(tmp_path: Path) -> None:
    """Measures that are left out are named with the reason, and figures are those of the parts that are there."""
    tick = part_of(ours__tick__9=[0.002], zenoh__tick__9=[0.001])
    tick.left_out["HELICS zmq"] = "helics is not installed"
    parts: dict[str, PartRun] = {"tick": tick, "agents": part_of(ours__full__3=[0.001], zenoh__full__3=[0.0005])}

    written = page.write_page(parts, tmp_path, list(PARTS)).read_text(encoding="utf-8")

    assert "bare Zenoh, empty | 1 ms | 2 ms | 0.5 | (1) |" in written
    assert "left out: HELICS zmq: helics is not installed" in written
    assert [file.name for file in (tmp_path / "images/performance").iterdir()] == ["agents.svg"]
    assert "(images/performance/agents.svg)" in written
    assert "(images/performance/scale.svg)" not in written


def test_a_figure_is_drawn_of_every_part_that_has_one(tmp_path: Path) -> None:
    """Cost against agents and links comes from the measurements, in one process too."""
    scale = {
        f"scale__100__{n}__{name}": [0.1] for n in (9, 99) for name in ("by_the_clock", "plant_per_s", "agents_per_s")
    }
    parts = {
        "links": part_of(inprocess__link__ring__9=[1e-5], inprocess__tick__ring__9=[1e-3]),
        "scale": part_of(**scale, scale__100__9__us_per_message=[14.0]),
    }

    page.write_page(parts, tmp_path, list(PARTS))

    assert {file.name for file in (tmp_path / "images/performance").iterdir()} == {"links.svg", "scale.svg"}


def test_stored_measurements_are_read_back_as_they_were(tmp_path: Path) -> None:
    """The page that is written later stands on the same numbers."""
    parts = {"tick": part_of(ours__tick__9=[0.002, 0.003])}

    save_parts(parts, tmp_path / "docs" / DATA_FILE)

    assert read_parts(tmp_path / "docs" / DATA_FILE) == parts
    assert [file.name for file in (tmp_path / "docs").iterdir()] == [DATA_FILE]
