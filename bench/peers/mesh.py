"""The bare lock-step of a mesh: messages of the sizes of ours between as many processes, and nothing else.

One process is the hub, as the plant is; the others are hosts of one or more agents. In each round the hub sends every
agent a measurement; a host that has the measurements of its agents, and the states of all others of the round before,
sends the states of its own; the hub waits for all. No codec, no law, no plant: the floor under lock-step over a
transport (`zenoh`, `zenoh-star`, `zeromq`), or the cost of HELICS with federates that compute nothing.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import msgspec

DEADLINE = 120.0
"""Longest time (s) for a mesh to form and to do its rounds."""

LEAVING = 5.0
"""Time (s) that hosts have to end by themselves after the hub."""

WARM_UP = 20
"""Rounds that are not counted."""

HUB = "hub"


class MeshMember(msgspec.Struct, frozen=True, kw_only=True):
    """The configuration of one process of a mesh."""

    transport: str
    """zenoh, zenoh-star, zeromq, helics-zmq or helics-tcp."""
    name: str
    """HUB, or the name of a host."""
    hosts: dict[str, tuple[str, ...]]
    """The agents of each host."""
    neighbours: dict[str, tuple[str, ...]]
    """The agents whose states each agent waits for."""
    folder: str
    """Where all can write: sockets, and the hub's address."""
    rounds: int
    measurement_size: int
    state_size: int
    """Bytes of a message."""

    @property
    def is_hub(self) -> bool:
        """Whether this is the hub."""
        return self.name == HUB

    @property
    def agents(self) -> tuple[str, ...]:
        """The agents of this process."""
        return self.hosts.get(self.name, ())

    @property
    def others(self) -> tuple[str, ...]:
        """The other processes."""
        return tuple(name for name in (HUB, *self.hosts) if name != self.name)

    @property
    def heard(self) -> tuple[str, ...]:
        """The agents in other processes whose states this process waits for in each round."""
        if self.is_hub:
            return tuple(agent for agents in self.hosts.values() for agent in agents)
        wanted = dict.fromkeys(other for agent in self.agents for other in self.neighbours[agent])
        return tuple(other for other in wanted if other not in self.agents)


def full_graph(agents: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Return the neighbours of each agent where all hear all."""
    return {agent: tuple(other for other in agents if other != agent) for agent in agents}


def shared_out(agents: Sequence[str], processes: int) -> dict[str, tuple[str, ...]]:
    """Share agents out over processes, neighbours together.

    Examples
    --------
    >>> shared_out(["a", "b", "c"], 2)
    {'host0': ('a', 'b'), 'host1': ('c',)}
    """
    each, more = divmod(len(agents), processes)
    sizes = [each + (i < more) for i in range(processes)]
    return {f"host{i}": tuple(agents[sum(sizes[:i]) : sum(sizes[: i + 1])]) for i in range(processes)}


def seconds_per_round(
    transport: str,
    neighbours: dict[str, tuple[str, ...]],
    *,
    rounds: int,
    sizes: tuple[int, int],
    processes: int = 0,
) -> float:
    """Return the time (s) of a round of a mesh, its start not counted.

    `neighbours` are the agents, and whose states each waits for; `sizes` the bytes of a measurement and of a state;
    `processes` those that agents share, where 0 gives each agent its own.
    """
    hosts = shared_out(tuple(neighbours), processes or len(neighbours))
    with tempfile.TemporaryDirectory(prefix="gp-mesh-") as folder:
        members = [
            MeshMember(
                transport=transport,
                name=name,
                hosts=hosts,
                neighbours=neighbours,
                folder=folder,
                rounds=rounds,
                measurement_size=sizes[0],
                state_size=sizes[1],
            )
            for name in (HUB, *hosts)
        ]
        log, answer = Path(folder) / "log", b""
        with log.open("ab") as errors:
            children = [
                subprocess.Popen(
                    [sys.executable, "-m", "bench.peers.mesh_process", msgspec.json.encode(member)],
                    stdout=subprocess.PIPE if member.is_hub else errors,
                    stderr=errors,
                    cwd=Path(__file__).parents[2],
                )
                for member in members
            ]
            try:
                with suppress(subprocess.TimeoutExpired):
                    answer = children[0].communicate(timeout=DEADLINE)[0]
            finally:
                for child in children:
                    try:
                        child.wait(LEAVING if answer else 0.0)
                    except subprocess.TimeoutExpired:
                        child.kill()
                        child.wait()
        if not answer:
            raise RuntimeError(f"{transport}: the mesh did not end: {log.read_text(errors='replace')[-1500:]}")
    return float(answer) / rounds
