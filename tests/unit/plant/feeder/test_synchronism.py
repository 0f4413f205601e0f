"""The closing of a switch between live islands is measured, and refused, delayed or reported."""

from __future__ import annotations

from math import degrees, pi

import pytest
from msgspec.structs import replace

from gridpeers.plant.feeder import Plant
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import PlantSettings, SwitchEvent, SyncCheck
from gridpeers.plant.plant_node import PlantNode
from gridpeers.wire.codec import decode, encode
from gridpeers.wire.messages import Answer, Command
from gridpeers.wire.node import Publish
from tests.toy.toy_configs import toy_configs

T_C = 0.02
ISLANDING = SwitchEvent(t=0.1, switch="13-152", action="open")


def plant(network: Network, *events: SwitchEvent, **check: float) -> Plant:
    """The microgrid feeder, islanded at 0.1 s, with these switchings."""
    settings = PlantSettings(events=(ISLANDING, *events), sync_check=SyncCheck(**check))
    return Plant(network, settings, T_C, T_C)


def run(p: Plant, until: float) -> list[str]:
    """Advance to a time; what was told of switches."""
    while p.tick * T_C < until - 1e-9:
        p.advance()
    return [f"{event.t:.2f} {event.text}" for event in p.take_events() if event.kind in ("switch", "warning", "trip")]


def close(t: float, *, synchronised: bool) -> SwitchEvent:
    return SwitchEvent(t=t, switch="13-152", action="close", synchronised=synchronised)


def drift(p: Plant, until: float) -> float:
    """Angle (deg) by which inv1 turns against 60 Hz until a time, from its frequency."""
    angle = 0.0
    while p.tick * T_C < until - 1e-9:
        before = p.measure()["inv1"].f
        p.advance()
        angle += 2.0 * pi * (0.5 * (before + p.measure()["inv1"].f) - 60.0) * T_C
    return degrees(angle)


def apart(p: Plant) -> tuple[float, float]:
    """Angle (deg) and frequency (Hz) across the switch to the grid, as a refusal tells them."""
    with pytest.raises(ValueError, match=r"switch 13-152 not closed: its sides are .* allowed are") as refused:
        p.switch("13-152", "close", synchronised=True)
    words = str(refused.value).split()
    return float(words[words.index("deg,") - 1]), float(words[words.index("Hz") - 1])


def test_the_angle_across_a_switch_grows_as_the_frequencies_differ(network: Network) -> None:
    """In half a second the reported angle grows by the integral of the island's frequency above 60 Hz."""
    p = plant(network)
    run(p, 2.5)
    first, _ = apart(p)
    turned = drift(p, 3.0)
    second, off = apart(p)

    assert turned < -20.0
    assert second - first == pytest.approx(-turned, abs=0.15)  # both are told to a tenth of a degree
    assert off == pytest.approx(60.0 - p.measure()["inv1"].f, abs=1e-3)


def test_closing_out_of_step_gives_a_warning_with_the_angle(network: Network) -> None:
    """Without the check the switch closes, and a warning has the differences."""
    p = plant(network, close(2.5, synchronised=False))
    run(p, 2.5)
    angle, f = apart(p)
    told = run(p, 2.6)

    assert told[0].startswith(f"2.50 switch 13-152 joins two live islands: its sides are {angle} deg, {f} Hz and ")
    assert told[1] == "2.50 switch 13-152 closed"


def test_a_switch_waits_until_its_sides_are_in_step(network: Network) -> None:
    """With the check it closes when the island, 0.136 Hz slow, is in phase again; nothing trips."""
    p = plant(network, close(2.5, synchronised=True), f=0.2, V=0.1)
    told = run(p, 12.0)

    assert told[1].startswith("2.50 switch 13-152 waits for synchronism: its sides are ")
    assert "allowed are at most 10 deg, 0.2 Hz and 10 %" in told[1]
    assert len(told) == 3
    assert " switch 13-152 closed in step: " in told[2]
    assert float(told[2].split()[6]) <= 10.0
    assert 3.0 < float(told[2].split()[0]) < 12.0
    closed = float(told[2].split()[0])
    after = [abs(row[1 + 6 * i] - 60.0) for row in p.take_rows() for i in (0, 3, 6) if row[0] > closed + 0.005]
    assert max(after) < 1.0  # 0.64 Hz; 6.7 Hz when it closes 123 degrees out of phase
    assert p.measure()["inv1"].grid_connected


def test_a_switch_that_is_never_in_step_gives_up(network: Network) -> None:
    """Droop leaves the island 0.136 Hz slow: beyond the 0.1 Hz for 3900 kVA; after the timeout there is a warning."""
    p = plant(network, close(2.5, synchronised=True), timeout=2.0)
    told = run(p, 5.0)

    assert told[2].startswith("4.50 switch 13-152 not closed: not in step within 2 s, now ")
    assert "allowed are at most 10 deg, 0.1 Hz and 3 %" in told[2]
    assert not p.measure()["inv1"].grid_connected


def test_opening_a_switch_ends_its_wait(network: Network) -> None:
    p = plant(network, close(2.5, synchronised=True), SwitchEvent(t=3.0, switch="13-152", action="open"), f=1.0)
    told = run(p, 12.0)

    assert told[2] == "3.00 switch 13-152 was open already"
    assert len(told) == 3


def test_one_island_or_a_de_energised_side_needs_no_synchronism(network: Network) -> None:
    """A loop within one island, and a side without voltage, close at once and without a warning."""
    zone = (SwitchEvent(t=0.5, switch="60-160", action="open"), SwitchEvent(t=0.5, switch="61-61s", action="open"))
    p = plant(network, SwitchEvent(t=0.2, switch="18-135", action="close"), *zone)
    run(p, 1.0)
    assert run(p, 1.0) == []
    p.switch("60-160", "close", synchronised=True)

    told = run(p, 1.1)

    assert told == ["1.00 switch 60-160 closed"]


def test_islands_that_meet_across_a_de_energised_zone_give_a_warning(network: Network) -> None:
    """Two switches that close at once around buses without voltage join the live parts behind them."""
    p = plant(network, SwitchEvent(t=0.1, switch="60-160", action="open"))
    run(p, 2.0)
    p.switch("60-160", "close")
    p.switch("13-152", "close")

    told = run(p, 2.1)

    assert sum("joins two live islands: its sides are " in line for line in told) == 2


def test_the_command_to_close_in_step_is_answered_with_the_differences(network: Network) -> None:
    """`gridpeers event close --synchronised` is refused with the plant's reason, and the run goes on."""
    p = plant(network)
    run(p, 2.5)
    config = replace(toy_configs(9, end=60.0)[0], clock="realtime")
    side = PlantNode(config, p)
    side.start(0.0)
    command = Command(sender="visitor", epoch=0, seq=0, t=0.0, verb="synchronise", argument="13-152", reply_to="v")
    side.received(side.keys.command, encode(command), 0.1)

    (answer,) = [
        message
        for action in side.take_actions()
        if isinstance(action, Publish) and isinstance(message := decode(action.payload), Answer)
    ]
    assert not answer.ok
    assert "switch 13-152 not closed: its sides are " in answer.text
    assert run(p, 2.6) == []
    assert not p.switch("13-152", "close"), "without the check it is operated"
