"""The parts of the bench: what is measured beside what."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import NamedTuple

from bench.peers import our_scale
from bench.peers.measured import Measure
from bench.peers.mesh import full_graph, ring_graph, seconds_per_round
from bench.peers.our_case import OurCase, help_time

PACKAGE = {"zenoh": "", "zeromq": "pyzmq", "helics-zmq": "helics", "helics-tcp": "helics"}
"""Distribution that a transport needs beyond our own dependencies."""

GRAPHS = {"full": full_graph, "ring": ring_graph}


class BenchPart(NamedTuple):
    """One part of the bench, whose measures take turns."""

    measures: Callable[[Extent], Sequence[Measure]]
    text: str
    """For the help."""


class Extent(NamedTuple):
    """How much is measured: all of it for the page, a little in tests."""

    rounds: int = 5
    end: float | None = None
    """Duration (s) of our case instead of the experiment's 7 s."""
    mesh_rounds: int = 300
    runs: int = 80
    """Runs of the sweep."""
    sizes: Sequence[int] = (3, 9, 18, 30)
    """Numbers of agents as processes."""
    rings: Sequence[int] = (9, 30, 99, 300)
    full: Sequence[int] = (9, 18, 36, 72)
    """Numbers of agents in one process, in a ring and in a full graph."""
    ticks: int = 50
    """Ticks of a run of another size than nine."""


SHORT = Extent(rounds=1, end=0.2, mesh_rounds=5, runs=2, sizes=(3,), rings=(9,), full=(), ticks=5)
"""As much as a test needs."""


def plant(extent: Extent) -> list[Measure]:
    """Our plant beside GridLAB-D."""
    case = OurCase(extent.end)
    case.plant_alone()  # loads the compiled step
    return [
        Measure("our plant", case.plant_alone),
        Measure("GridLAB-D", case.gridlabd_alone, "gridlabd", rounds=3),
    ]


def case(extent: Extent) -> list[Measure]:
    """One case in process, its parts, the command's help, and a sweep."""
    ours = OurCase(extent.end)
    ours.in_process()

    def parts() -> Mapping[str, float]:
        return {f"share.{name}": value for name, value in ours.shares().items()}

    return [
        Measure("our case in process", ours.in_process),
        Measure("its parts", parts),
        Measure("gridpeers --help", help_time),
        Measure("our sweep", partial(ours.sweep, extent.runs), "joblib", rounds=2),
    ]


def tick(extent: Extent) -> list[Measure]:
    """A lock-step tick of nine agents beside HELICS, ZeroMQ and bare Zenoh on the same mesh."""
    ours = OurCase(extent.end)
    agents = [agent.name for agent in ours.agents]

    def mesh(transport: str, processes: int) -> Mapping[str, float]:
        seconds = seconds_per_round(
            transport, full_graph(agents), rounds=extent.mesh_rounds, sizes=ours.sizes, processes=processes
        )
        return {f"{transport}.tick.{processes or len(agents)}": seconds}

    return [
        Measure("ours, first case of a process", ours.first_with_processes, rounds=3),
        Measure("ours, a process for each agent", ours.with_processes),
        Measure("bare Zenoh", partial(mesh, "zenoh", 0)),
        Measure("bare Zenoh, the hub relays", partial(mesh, "zenoh-star", 0)),
        Measure("ours, three agents a process", partial(ours.with_processes, 3)),
        Measure("bare Zenoh, three agents a process", partial(mesh, "zenoh", 3)),
        Measure("bare Zenoh, three agents a process, the hub relays", partial(mesh, "zenoh-star", 3)),
        Measure("ZeroMQ ipc", partial(mesh, "zeromq", 0), "pyzmq"),
        Measure("HELICS zmq", partial(mesh, "helics-zmq", 0), "helics"),
        Measure("HELICS tcp", partial(mesh, "helics-tcp", 0), "helics"),
    ]


def _rounds(agents: int, many: int) -> int:
    """Return the rounds of a size: one from so many agents on, so that the whole bench takes some minutes."""
    return 1 if agents >= many else 2


def agents(extent: Extent) -> list[Measure]:
    """A tick against the number of agents, a process each, beside bare Zenoh and ZeroMQ."""
    sizes = OurCase(extent.end).sizes

    def mesh(transport: str, graph: str, n: int) -> Mapping[str, float]:
        neighbours = GRAPHS[graph]([f"inv{i}" for i in range(n)])
        seconds = seconds_per_round(transport, neighbours, rounds=max(extent.mesh_rounds // 4, 5), sizes=sizes)
        return {f"{transport}.{graph}.{n}": seconds}

    measures = []
    for n in extent.sizes:
        for graph in GRAPHS if n > 3 else ("full",):  # three in a ring are three in a full graph
            measures.append(
                Measure(
                    f"ours, {graph}, {n}",
                    partial(our_scale.with_processes, n, graph, extent.ticks),
                    rounds=_rounds(n, 18),
                )
            )
            for transport in ("zenoh", "zeromq"):
                measure = partial(mesh, transport, graph, n)
                measures.append(
                    Measure(f"{transport}, {graph}, {n}", measure, PACKAGE[transport], rounds=_rounds(n, 18))
                )
    return measures


def links(extent: Extent) -> list[Measure]:
    """The cost of a message in one process, against the number of agents and of links."""
    return [
        Measure(
            f"in process, {graph}, {n}",
            partial(our_scale.in_process, n, graph, extent.ticks),
            rounds=_rounds(n, 72),
        )
        for graph, sizes in (("ring", extent.rings), ("full", extent.full))
        for n in sizes
    ]


PARTS = {
    "plant": BenchPart(plant, "the plant beside GridLAB-D"),
    "case": BenchPart(case, "one case in process and its parts, the command's help, a sweep"),
    "tick": BenchPart(tick, "a tick with processes beside HELICS, ZeroMQ, bare Zenoh; a case start to end"),
    "agents": BenchPart(agents, "a tick against the number of agents, as processes"),
    "links": BenchPart(links, "the cost of a message in one process against the number of links"),
}
