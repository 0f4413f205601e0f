"""A closed loop gives the run back without a change, and under one the run that was recorded with that change.

The runs are of the toy plant on a fake clock, where every message takes a millisecond unless a test says otherwise.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

import pytest
from msgspec.structs import replace

from gridpeers.agents.agent_config import Control, LawChoice
from gridpeers.lab.replay.changes import ChangedRule, Changes
from gridpeers.lab.replay.closed_loop import ClosedLoop
from gridpeers.lab.replay.replay import replay
from gridpeers.netem.schema.fault import Fault
from gridpeers.netem.schema.netem import Netem
from gridpeers.scenarios.emulation.link_data import EmulationConfig
from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.wire.messages import LinkReport, PlantEvent, Telemetry
from tests.record.fake_clock import FakeClockRun, fake_clock_record
from tests.toy.toy_configs import ALL_FULL
from tests.toy.toy_plant import ToyPlant

Rows = list[tuple[float, ...]]

CUT = Netem(links=(Fault(on="inv1 -> inv2", cut=True, from_s=0.3, to_s=0.8),))


def told(messages: list[Telemetry]) -> tuple[Rows, list[PlantEvent]]:
    return [row for each in messages for row in each.rows], [event for each in messages for event in each.events]


def again(record: RunRecord, changes: Changes | None = None, **rule: Any) -> tuple[Rows, list[PlantEvent]]:
    found: list[Telemetry] = []

    def take(message: Telemetry | LinkReport) -> None:
        if isinstance(message, Telemetry):
            found.append(message)

    changed = None
    if changes is not None:
        changed = ChangedRule(**(dict.fromkeys(ChangedRule.__annotations__) | {"changes": changes} | rule))
    ClosedLoop(record, cast(ChangedRule | None, changed), take, ToyPlant).run()
    return told(found)


def links_of(record: RunRecord, netem: Netem) -> dict[str, Any]:
    microgrids = {agent.name: agent.microgrid for agent in record.info.agents}
    return EmulationConfig(netem=netem, microgrids=microgrids, real_nodes=True).to_tree()


def uneven(src: str, dst: str, key: str, number: int) -> float | None:
    """Messages late by 1 to 5 ms, by a rule; every seventh state between two agents is lost."""
    if key.startswith("state/") and "plant" not in (src, dst) and number % 7 == 3:
        return None
    return 0.001 * (1 + (number * 7 + len(key)) % 5)


def much_happens(run: FakeClockRun) -> None:
    """An agent is frozen, one dies and comes again, one leaves, and people command."""
    run.at(0.2, lambda: run.freeze("inv3", 0.5))
    run.at(0.5, lambda: run.command("open", argument="sw1"))
    run.at(0.8, lambda: run.kill("inv2"))
    run.at(1.0, lambda: run.start("inv2"))
    run.at(1.1, lambda: run.stop("inv1"))
    run.at(1.15, lambda: run.command("link", link_command={"fault": {"on": "inv2 -> inv3", "cut": True}}))
    run.at(1.2, lambda: run.start("inv1"))


def test_without_a_change_the_loop_gives_rows_and_events_back(tmp_path: Path) -> None:
    """Who joined, left, died, was silent or was not heard by whom: all to the bit, at the times at which it was."""
    record = fake_clock_record(tmp_path / "case", end=1.5, netem=CUT, delay=uneven, happens=much_happens)

    rows, events = again(record)

    assert (rows, events) == told(list(record.telemetry()))
    texts = "; ".join(event.text for event in events)
    for text in ("inv2 does not hear inv1", "inv3 is silent", "inv2 died", "inv1 left", "link command 1", "sw1: open"):
        assert text in texts
    assert replay(record, ToyPlant).difference is None


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> RunRecord:
    """A run of three agents in which nothing goes wrong."""
    return fake_clock_record(tmp_path_factory.mktemp("plain") / "case")


def test_a_cut_link_gives_the_run_with_that_cut(plain: RunRecord, tmp_path: Path) -> None:
    """From its time on, and to the bit; the same with the cut as a fault of the scenario."""
    netem = Netem(links=(Fault(on="inv1 -> inv2", cut=True, from_s=0.5),))
    cut = told(list(fake_clock_record(tmp_path / "case", netem=netem).telemetry()))

    found = again(plain, Changes(without=("inv1 -> inv2",), since=0.5), links=links_of(plain, netem))

    assert found == cut
    assert found[0] != told(list(plain.telemetry()))[0]


def test_another_gain_gives_the_run_with_that_gain(plain: RunRecord, tmp_path: Path) -> None:
    """A gain from the start decides every step."""
    control = replace(ALL_FULL, gains=replace(ALL_FULL.gains, k_p=0.5 * ALL_FULL.gains.k_p))
    other = told(list(fake_clock_record(tmp_path / "case", control=control).telemetry()))

    assert again(plain, Changes(keys={"gains.k_p": 1}), control=control) == other
    assert other[0] != told(list(plain.telemetry()))[0]


def test_messages_that_the_record_lacks_come_as_those_of_their_link(tmp_path: Path) -> None:
    """A law that saved messages is replaced: the states that it did not send are sent, and take the link's delays."""
    saves = Control(secondary="all", graph="full", law=LawChoice(use="event-triggered"))
    saving, talking = (
        fake_clock_record(tmp_path / name / "case", control=control)
        for name, control in (("saves", saves), ("talks", ALL_FULL))
    )

    assert again(saving) == told(list(saving.telemetry()))
    assert again(saving, Changes(law="consensus"), control=ALL_FULL) == told(list(talking.telemetry()))
    assert again(talking, Changes(law="event-triggered"), control=saves) == told(list(saving.telemetry()))
    assert told(list(saving.telemetry()))[0] != told(list(talking.telemetry()))[0]
