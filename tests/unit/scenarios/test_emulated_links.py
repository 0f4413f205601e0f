"""Faults of nodes at the ends of emulated links."""

from __future__ import annotations

from netem.models.gates import Cut
from netem.schema.fault import Fault
from netem.schema.netem import Netem
from netem.schema.node_fault import NodeFault
from scenarios.emulation.emulated_links import EmulatedLinks
from scenarios.emulation.emulation_config import EmulationConfig
from wire.messages import State

PAUSE = NodeFault(name="inv1", from_s=1.7, to_s=2.7, pause=True)


def _arrivals(*links: Fault) -> dict[float, list[float]]:
    """Times (s) at which states of inv2 were sent, by the tick at which inv1, paused from 1.7 to 2.7 s, takes them."""
    config = EmulationConfig(netem=Netem(links=links, nodes=(PAUSE,)), microgrids={"inv1": "mg1", "inv2": "mg1"})
    side, found = EmulatedLinks("inv1", config), dict[float, list[float]]()
    sent = {k: State(sender="inv2", epoch=1, seq=k, t=0.1 * k, P_set=0.0, V_set=277.0, Q=0.0) for k in range(40)}
    for k, state in sent.items():
        side.offer(state, b"state", state.t)
        for arrival in side.due(0.1 * k + 1e-9):
            assert isinstance(arrival.message, State)
            found.setdefault(round(0.1 * k, 1), []).append(round(arrival.message.t, 1))
    return found


def test_a_paused_agent_takes_what_has_come_when_it_goes_on() -> None:
    """Nothing is taken during the pause, all of it at its end, and later messages at once."""
    found = _arrivals()

    assert [t for t in found if 1.65 < t < 2.65] == []
    assert found[2.7] == [round(0.1 * k, 1) for k in range(17, 28)]
    assert found[2.8] == [2.8]


def test_a_delay_goes_by_while_the_receiver_is_paused() -> None:
    """What a cut held until 2.1 s is there at 2.7 s: its link has long delivered it, and nothing waits behind."""
    found = _arrivals(Fault(on="inv2 -> inv1", from_s=1.5, to_s=2.1, cut=Cut(hold=True)))

    assert found[2.7] == [round(0.1 * k, 1) for k in range(15, 28)]
    assert found[2.8] == [2.8]


def test_a_message_that_is_still_on_its_way_at_the_end_of_a_pause_comes_later() -> None:
    """A link of 0.3 s delivers at 2.7 s what was sent by 2.4 s."""
    found = _arrivals(Fault(on="inv2 -> inv1", delay=0.3))

    assert found[2.7] == [round(0.1 * k, 1) for k in range(14, 25)]
    assert found[2.8] == [2.5]
