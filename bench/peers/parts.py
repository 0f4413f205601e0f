"""The parts of the bench: what is measured beside what."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import NamedTuple

from bench.harness import checked
from bench.peers.measured import Measure
from bench.peers.mesh import full_graph, seconds_per_round
from bench.peers.our_case import OurCase, help_time

PACKAGE = {"zenoh": "", "zenoh-star": "", "zeromq": "pyzmq", "helics-zmq": "helics", "helics-tcp": "helics"}
"""Distribution that a transport needs beyond our own dependencies."""


class Extent(NamedTuple):
    """How much is measured: all of it, or a little in tests."""

    rounds: int = 5
    end: float | None = None
    """Duration (s) of our case instead of the experiment's 7 s."""
    mesh_rounds: int = 500
    runs: int = 80
    """Runs of the sweep."""
    scale: Sequence[tuple[int, int]] = ((9, 100), (27, 100), (99, 100), (306, 100), (999, 100), (306, 20))
    """Numbers of agents in a new process, and T_c (ms)."""


SHORT = Extent(rounds=1, end=0.2, mesh_rounds=5, runs=2, scale=((9, 100),))
"""The smallest extent that runs every part, for tests."""

SCALED, SHORTEST = 600, 4
"""Agents times simulated seconds, and least simulated time (s), of a run of the part "scale"."""


def plant(extent: Extent) -> list[Measure]:
    """Our plant beside GridLAB-D."""
    case = OurCase(extent.end)
    case.plant_alone()  # loads the compiled step
    return [
        Measure("our plant", case.plant_alone),
        Measure("GridLAB-D", case.gridlabd_alone, "gridlabd"),
    ]


def case(extent: Extent) -> list[Measure]:
    """One case in process."""
    ours = OurCase(extent.end)
    ours.in_process()
    return [Measure("our case in process", ours.in_process)]


def sweep(extent: Extent) -> list[Measure]:
    """A sweep on all cores."""
    return [Measure("our sweep", partial(OurCase(extent.end).sweep, extent.runs), "joblib")]


def command(extent: Extent) -> list[Measure]:
    """The command in a process of its own: its help, and its first case with processes."""
    ours = OurCase(extent.end)
    ours.in_process()  # compiles the step on a clean clone: that would be in the first round alone
    return [Measure("gridpeers run", ours.by_command), Measure("gridpeers --help", help_time)]


def tick(extent: Extent) -> list[Measure]:
    """A lock-step tick of nine agents beside HELICS, ZeroMQ and bare Zenoh on the same mesh."""
    ours = OurCase(extent.end)
    agents = [agent.name for agent in ours.agents]
    ours.with_processes()  # starts what plant and agents are forked from

    def rival(name: str, transport: str, processes: int = 0) -> Measure:
        def mesh() -> Mapping[str, float]:
            seconds = seconds_per_round(
                transport, full_graph(agents), rounds=extent.mesh_rounds, sizes=ours.sizes, processes=processes
            )
            return {f"{transport}.tick.{processes or len(agents)}": seconds}

        return Measure(name, mesh, PACKAGE[transport])

    return [
        Measure("ours, a process for each agent", ours.with_processes),
        rival("bare Zenoh", "zenoh"),
        rival("bare Zenoh, the hub relays", "zenoh-star"),
        Measure("ours, three agents a process", partial(ours.with_processes, 3)),
        rival("bare Zenoh, three agents a process", "zenoh", 3),
        rival("bare Zenoh, three agents a process, the hub relays", "zenoh-star", 3),
        rival("ZeroMQ ipc", "zeromq"),
        rival("HELICS zmq", "helics-zmq"),
        rival("HELICS tcp", "helics-tcp"),
    ]


def scale(extent: Extent) -> list[Measure]:
    """Cost of a simulated second in one process, on a ring, up to 999 agents."""

    def run(agents: int, T_c_ms: int) -> Mapping[str, float]:
        words = (f"{agents}", f"{T_c_ms / 1e3:g}", f"{max(SHORTEST, round(SCALED / agents))}")
        row: dict[str, float] = json.loads(checked([sys.executable, "-m", "bench.peers.our_scale", *words]))
        return {f"scale.{T_c_ms}.{agents}.{name}": value for name, value in row.items()}

    return [
        Measure(f"{agents} agents in process, T_c {T_c_ms} ms", partial(run, agents, T_c_ms))
        for agents, T_c_ms in extent.scale
    ]


PARTS: dict[str, Callable[[Extent], Sequence[Measure]]] = {
    "plant": plant,
    "case": case,
    "sweep": sweep,
    "command": command,
    "tick": tick,
    "scale": scale,
}
"""By part, the function that returns its measures; rivals of a part take turns."""
