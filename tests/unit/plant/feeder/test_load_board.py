"""Loads that people set while a run goes on, or a scenario: what the plant then has, and what it refuses."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from gridpeers.plant.dynamics import live_network
from gridpeers.plant.equipment.named_loads import named_loads, with_powers
from gridpeers.plant.feeder import Plant
from gridpeers.plant.feeder.switchboard import LoadBoard
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import LoadEvent, PlantSettings, SwitchEvent
from gridpeers.plant.tables import read_feeder
from gridpeers.wire.messages import LoadSetting
from tests.unit.plant.feeder.test_feeder import T_C, plant, run

ISLANDED = SwitchEvent(t=0.02, switch="13-152", action="open")


def test_a_set_load_acts_as_a_load_of_the_table() -> None:
    """In an island the powers settle at those of a plant whose table has the load from the start."""
    p = plant(ISLANDED)
    run(p, 0.1)
    words = p.set_load("48", LoadSetting(factor=1.5))
    at = p.tick * T_C
    run(p, 6.1)

    table = read_feeder("microgrid123")
    S = 1.5 * named_loads(table)["48"].S
    other = Plant(Network(with_powers(table, {"48": S})), PlantSettings(events=(ISLANDED,)), T_C, T_C)
    run(other, 6.1)

    assert words == "load 48: 315 kW and 225 kvar at nominal voltage, 1.5 times its table"
    (told,) = [event for event in p.take_events() if event.kind == "load"]
    assert (told.t, told.subject) == (pytest.approx(at), "48")
    assert (S.real, S.imag) == (told.P, told.Q)
    assert told.text == "load 48 set to 315 kW and 225 kvar at nominal voltage, 1.5 times its table"
    assert p.loads == {"48": S}
    for name, reading in p.measure().items():
        assert pytest.approx([getattr(other.measure()[name], key) for key in ("P", "Q", "V")], rel=1e-4) == [
            reading.P,
            reading.Q,
            reading.V,
        ]


def test_a_load_is_changed_once_and_restored_to_the_byte() -> None:
    """With the table's power the load, and so the network, is the first one again."""
    first = Network(read_feeder("microgrid123"))
    board = LoadBoard(first)
    board.put("48", LoadSetting(P=0.0, Q=0.0))
    off, _ = board.apply(1)
    assert not board.is_due(1)
    board.put("48", LoadSetting(factor=1.0))
    again, (event,) = board.apply(2)

    assert event.text == "load 48 set to 210 kW and 150 kvar at nominal voltage, as in its table"
    assert board.changed == {}
    assert len(off.loads()) == len(first.loads()), "a load that is set to nothing keeps its branches"
    assert (again.Y_loads != first.Y_loads).nnz == 0
    np.testing.assert_array_equal(again.loads().law.S, first.loads().law.S)
    np.testing.assert_array_equal(again.loads().law.I0, first.loads().law.I0)


@pytest.mark.parametrize(("name", "setting", "said"), [
    ("1000", LoadSetting(factor=1.0), 'load "1000": no such load; did you mean "100"?'),
    ("48", LoadSetting(factor=-1.0), "load 48: a factor on a load must not be negative, got -1"),
    ("48", LoadSetting(factor=11.0), r"load 48: 11 is not plausible for a factor on a load \(0 to 10\)"),
    ("48", LoadSetting(P=-1.0), "load 48: the real power of a load must not be negative, got -0.001 kW"),
    ("48", LoadSetting(P=210e6), r"210000 kW is not plausible .*; did you mean 210 \(210000 W\)\?"),
    ("48", LoadSetting(), "load 48: takes either a factor, or real or reactive power"),
    ("48", LoadSetting(factor=1.0, P=1e3), "load 48: takes either a factor, or real or reactive power"),
    ("48", LoadSetting(Q=-90e6), "-90000 kvar is not plausible for the reactive power of a load"),
])  # fmt: skip
def test_an_invalid_setting_is_refused_and_changes_nothing(name: str, setting: LoadSetting, said: str) -> None:
    """The message says what would be right."""
    board = LoadBoard(Network(read_feeder("microgrid123")))

    with pytest.raises(ValueError, match=said):
        board.put(name, setting)
    assert not board.is_due(0)


def every_load(t: float, factor: float) -> tuple[LoadEvent, ...]:
    """A change of all loads of microgrid123."""
    names = named_loads(read_feeder("microgrid123"))
    return tuple(LoadEvent(t=t, load=name, setting=LoadSetting(factor=factor)) for name in names)


def kinds(p: Plant) -> set[str]:
    return {event.kind for event in p.take_events()}


def test_a_scheduled_change_equals_a_live_one() -> None:
    """The same rows to the last bit, and the same event."""
    changes = {"48": LoadSetting(factor=1.5), "65": LoadSetting(P=0.0, Q=0.0)}
    scheduled = plant(
        ISLANDED, loads=tuple(LoadEvent(t=0.1, load=name, setting=setting) for name, setting in changes.items())
    )
    by_hand = plant(ISLANDED)
    run(scheduled, 0.3)
    run(by_hand, 0.1)
    for name, setting in changes.items():
        by_hand.set_load(name, setting)
    run(by_hand, 0.3)

    assert scheduled.take_rows() == by_hand.take_rows()
    events = scheduled.take_events()
    assert events == by_hand.take_events()
    assert [(event.t, event.subject) for event in events if event.kind == "load"] == [(0.1, "48"), (0.1, "65")]
    assert scheduled.loads == by_hand.loads


def test_switches_and_loads_of_one_step_change_at_once() -> None:
    """The island starts with its new loads, never with the former ones, which it could not feed."""
    heavy, light = every_load(0.04, 2.5), every_load(0.1, 1.0)
    opening = SwitchEvent(t=0.1, switch="13-152", action="open")
    together = plant(opening, loads=(*heavy, *light))
    late = plant(opening, loads=(*heavy, *every_load(0.102, 1.0)))
    for p in (together, late):
        run(p, 0.12)

    assert "trip" not in kinds(together)
    assert "trip" in kinds(late)


def test_networks_of_scheduled_loads_are_factored_before_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """In real time an event must not make its step late."""
    factored: list[int] = []
    real = live_network.Reduction

    def counted(*arguments: Any) -> Any:
        factored.append(p.tick)
        return real(*arguments)

    p = plant(ISLANDED, loads=(*every_load(0.04, 0.9), *every_load(0.08, 1.0)))
    monkeypatch.setattr(live_network, "Reduction", counted)
    run(p, 0.1)
    assert factored == []
    p.set_load("48", LoadSetting(factor=2.0))
    run(p, 0.12)
    assert factored == [5]


def test_an_invalid_schedule_is_refused_at_the_start() -> None:
    """A wrong setting from Python is an error before the run, not at its event."""
    with pytest.raises(ValueError, match='load "4800": no such load'):
        plant(loads=(LoadEvent(t=0.02, load="4800", setting=LoadSetting(factor=0.5)),))
    with pytest.raises(ValueError, match="load 48: the real power of a load must not be negative"):
        plant(loads=(LoadEvent(t=0.02, load="48", setting=LoadSetting(P=-1.0)),))
