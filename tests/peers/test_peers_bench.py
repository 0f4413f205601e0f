"""The bench beside peers: that every rival runs, and what its page says. Its numbers are not judged here."""

import json
from pathlib import Path

import pytest

from bench.peers import page
from bench.peers.criteria import CRITERIA, Criterion
from bench.peers.measured import Measure, PartRun, measure_in_turns
from bench.peers.mesh import full_graph, ring_graph, seconds_per_round
from bench.peers.parts import PACKAGE, PARTS


def part_of(**values: list[float]) -> PartRun:
    """Return the measurements of a part, made up; "__" in a name is a dot."""
    return PartRun(
        began="2026-01-01 00:00 UTC",
        commit="abc",
        machine="a machine",
        versions={"pyzmq": "27"},
        loads=[0.1, 0.2],
        values={name.replace("__", "."): found for name, found in values.items()},
    )


@pytest.mark.parametrize("transport", PACKAGE)
def test_every_rival_does_the_rounds_of_a_mesh(transport: str) -> None:
    """Hub and agents meet, exchange all messages of some rounds, and end by themselves."""
    if PACKAGE[transport]:
        pytest.importorskip({"pyzmq": "zmq"}.get(PACKAGE[transport], PACKAGE[transport]))

    assert 0.0 < seconds_per_round(transport, full_graph(["a", "b"]), rounds=3, sizes=(200, 100)) < 10.0


def test_agents_of_one_process_share_its_messages() -> None:
    """A ring of four agents in two processes does its rounds, though some neighbours are in the own process."""
    agents = ring_graph(["a", "b", "c", "d"])

    assert seconds_per_round("zenoh", agents, rounds=3, sizes=(200, 100), processes=2) > 0.0


def test_a_rival_without_its_package_or_that_fails_is_left_out_and_named() -> None:
    """The others are measured all the same, in every round."""

    def fails() -> dict[str, float]:
        raise RuntimeError("no broker")

    measures = [
        Measure("ours", lambda: {"ours": 2.0}),
        Measure("theirs", lambda: {"theirs": 1.0}, "no-such-rival"),
        Measure("broken", fails),
        Measure("seldom", lambda: {"seldom": 3.0}, rounds=1),
    ]

    part = measure_in_turns(measures, rounds=3)

    assert part.values == {"ours": [2.0] * 3, "seldom": [3.0]}
    assert part.left_out["theirs"] == "no-such-rival is not installed: pip install 'gridpeers[bench]'"
    assert part.left_out["broken"] == "RuntimeError: no broker"
    assert len(part.loads) == 4


def test_a_number_that_is_asked_for_is_met_missed_or_not_measured() -> None:
    """The verdict follows from the medians; a limit itself is met."""
    parts = {"tick": part_of(ours__tick__9=[1.0, 1.6, 9.0], zenoh__tick__9=[1.0])}
    by_text = {criterion.text: criterion for criterion in CRITERIA}

    assert by_text["tick, a process for each agent: ours / bare Zenoh"].verdict(parts) == ("1.6", "<= 1.6", "met")
    assert by_text["plant: GridLAB-D / ours"].verdict(parts)[2] == "not measured"
    assert Criterion("x", lambda parts: 2.0, 3.0, at_least=True).verdict(parts)[2] == "missed"


def test_the_page_has_every_rival_its_ratio_and_who_was_left_out(tmp_path: Path) -> None:
    """A part that is not measured now is kept from the page that stands; JSON has the versions."""
    tick = part_of(ours__tick__9=[0.002], zenoh__tick__9=[0.001])
    tick.left_out["HELICS zmq"] = "helics is not installed"
    agents = part_of(ours__full__3=[0.001], zenoh__full__3=[0.0005])
    names = {name: part.text for name, part in PARTS.items()}
    page.write_page({"agents": agents}, tmp_path, names)

    written = page.write_page(page.read_parts(tmp_path) | {"tick": tick}, tmp_path, names).read_text(encoding="utf-8")

    assert "bare Zenoh, empty | 1 ms | 2 ms | 0.5 |" in written
    assert "left out: HELICS zmq: helics is not installed" in written
    assert (tmp_path / "images/performance/agents.svg").exists()
    assert json.loads((tmp_path / page.DATA_FILE).read_text())["tick"]["versions"] == {"pyzmq": "27"}
