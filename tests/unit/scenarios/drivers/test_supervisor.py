"""Process faults of a scenario, injected by the run time that telemetry has."""

from __future__ import annotations

from typing import Any

import pytest
from msgspec.structs import replace

from gridpeers.netem.schema.netem import Netem, NodeFault
from gridpeers.scenarios.drivers import supervisor
from gridpeers.scenarios.drivers.supervisor import FaultInjector
from gridpeers.scenarios.emulation.link_data import EmulationConfig
from tests.toy.toy_configs import toy_configs

MICROGRIDS = {"inv1": "mg1", "inv2": "mg1", "inv3": "mg1"}


def test_process_faults_come_in_turn_and_no_process_stays_paused(monkeypatch: pytest.MonkeyPatch) -> None:
    """At the run time that telemetry tells, at any speed; who is not there cannot be hurt; at the end all go on."""
    clock = [100.0]
    monkeypatch.setattr(supervisor, "monotonic", lambda: clock[0])
    nodes = (
        NodeFault(name="inv1", pause=True, from_s=2.0, to_s=4.0),
        NodeFault(name="inv2", kill=True, from_s=3.0),
        NodeFault(name="inv3", pause=True, from_s=5.0, to_s=99.0),
        NodeFault(name="inv9", kill=True, from_s=1.0),
    )
    sent: list[tuple[float, str, str]] = []

    class Victim:
        def __init__(self, name: str) -> None:
            self.name = name

        def signal(self, number: Any) -> None:
            sent.append((clock[0] - 100.0, self.name, number.name))

    children: Any = {name: Victim(name) for name in ("inv1", "inv2", "inv3")}
    links = EmulationConfig(netem=Netem(nodes=nodes), microgrids=MICROGRIDS, real_nodes=True).to_tree()
    injector = FaultInjector(replace(toy_configs(3)[0], clock="wall", speed=2.0, links=links))
    injector.inject(children)
    injector.note_time(0.02, 100.0)
    for _ in range(5):
        clock[0] += injector.wait
        injector.inject(children)
    injector.end(children)

    assert sent == [
        (1.0, "inv1", "SIGSTOP"), (1.5, "inv2", "SIGKILL"), (2.0, "inv1", "SIGCONT"), (2.5, "inv3", "SIGSTOP"),
        (2.5, "inv3", "SIGCONT"),
    ]  # fmt: skip
    assert injector.killed == {"inv2"}
