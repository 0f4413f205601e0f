"""A receiver believes a process only if a link has the certificate of its name, whatever access rules let through."""

from __future__ import annotations

from tests.toy.toy_messages import T_C
from tests.unit.agents.realtime_lab import Lab


def test_a_neighbour_whose_certificate_no_link_has_is_not_used() -> None:
    """Its nameplate is an impostor's, so none of its messages counts; both are reported."""
    lab = Lab()
    lab.side.post.vouches = {"plant", "inv2"}.__contains__
    lab.token("plant")
    lab.meet("inv2", "inv3")
    for k in range(1, 20):
        lab.measure(k)
        for name in ("inv2", "inv3"):
            lab.state(name, k, k * T_C)
        lab.go(T_C)

    assert lab.status().used == ("inv2",)
    assert lab.side.rejects.counts["impostor"] == 1
    (line,) = [line for line in lab.side.rejects.take_lines() if "impostor" in line]
    assert "inv3 says who it is, but no link has the certificate of inv3" in line


def test_a_plant_whose_certificate_no_link_has_commands_nobody() -> None:
    """The agent counts and drops its measurements, and waits for a plant."""
    lab = Lab()
    lab.side.post.vouches = {"inv2"}.__contains__
    lab.token("plant")
    lab.meet("inv2")
    for k in range(1, 10):
        lab.measure(k)
        lab.go(T_C)

    assert lab.side.phases.now != "running"
    assert lab.side.rejects.counts["impostor"] == 9
