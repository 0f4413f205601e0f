"""Processes of a run: where they listen, how they are ended, and faults that a scenario injects."""

from __future__ import annotations

import signal
import socket
from typing import Any, cast

import pytest
from msgspec.structs import replace

from gridpeers.netem.schema.netem import Netem, NodeFault
from gridpeers.scenarios.drivers import free_endpoint as free_endpoint_file
from gridpeers.scenarios.drivers import supervisor
from gridpeers.scenarios.drivers.children import Child, Children
from gridpeers.scenarios.drivers.free_endpoint import ListenError, free_endpoint
from gridpeers.scenarios.drivers.supervisor import FaultInjector
from gridpeers.scenarios.emulation.link_data import EmulationConfig
from tests.toy.toy_configs import toy_configs


def test_a_port_in_use_is_told_before_anything_starts() -> None:
    """The endpoint, the reason and the two ways out."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        text = f"tcp/127.0.0.1:{taken.getsockname()[1]}"

        with pytest.raises(
            ListenError, match=f"--listen: {text} cannot be used: address already in use; end its user .*kill -CONT"
        ):
            free_endpoint(text, option="--listen")


def test_no_two_choices_of_a_free_port_are_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    """A choice claims its port before anything listens there."""
    monkeypatch.setattr(free_endpoint_file, "_PORTS", range(24_000, 24_006, 2))

    assert {free_endpoint() for _ in range(3)} == {f"tcp/127.0.0.1:{port}" for port in (24_000, 24_002, 24_004)}
    with pytest.raises(ListenError, match="address already in use"):
        free_endpoint()


def test_an_address_of_another_machine_cannot_be_listened_on() -> None:
    """192.0.2.0/24 belongs to nobody: there is nothing to end there, and the line does not say so."""
    with pytest.raises(ListenError, match=r"cannot be used: .*; 192\.0\.2\.1 is not an address of this host") as told:
        free_endpoint("tcp/192.0.2.1:7447")

    assert "end its user" not in str(told.value)


class Process:
    """A process that says what is done to it, and ends when it is waited for, or by the last signal alone."""

    def __init__(self, name: str, said: list[str], *, ends: bool = True) -> None:
        self.name, self.status = name, cast(int | None, None)
        self._said, self._ends = said, ends

    def signal(self, number: int) -> None:
        """Note the signal; the last one ends every process."""
        self._said.append(f"{signal.Signals(number).name} to {self.name}")
        if number == signal.SIGKILL:
            self.status = -number

    def join(self, until: float) -> bool:
        if self._ends and self.status is None:
            self._said.append(f"{self.name} ends")
            self.status = 0
        return self.status is not None

    def release(self) -> None:
        """Close nothing."""


def all_of(*processes: Process) -> Children:
    children = Children()
    for process in processes:
        children.add(cast(Child, process))
    return children


def test_agents_are_asked_once_the_plant_has_gone() -> None:
    """One that is asked while its plant is there leaves, and the record has an inverter off the network at its end."""
    said: list[str] = []
    all_of(*(Process(name, said) for name in ("inv1", "plant", "inv2"))).end()

    asked = ["SIGTERM to plant", "plant ends", "SIGTERM to inv1", "SIGTERM to inv2"]
    assert said == [*asked, "inv1 ends", "inv2 ends"]


@pytest.mark.parametrize("plant", [(), ("plant",)])
def test_whoever_does_not_leave_is_killed(plant: tuple[str, ...]) -> None:
    """Whether there is a plant or not: every process is asked, and then ended."""
    said: list[str] = []
    all_of(*(Process(name, said, ends=False) for name in ("inv1", *plant))).end()

    asked = [*(f"SIGTERM to {name}" for name in plant), "SIGTERM to inv1"]
    assert said == [*asked, *(f"SIGKILL to {name}" for name in ("inv1", *plant))]


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
    injector = FaultInjector(replace(toy_configs(3)[0], clock="realtime", speed=2.0, links=links))
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
