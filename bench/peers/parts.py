"""The parts of the bench: what is measured beside what."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import NamedTuple

from bench.peers import our_command, our_hosts, our_scale
from bench.peers.measured import Measure
from bench.peers.mesh import full_graph, ring_graph, seconds_per_round
from bench.peers.our_case import OurCase
from bench.peers.rows import SCALE

PACKAGE = {"zenoh": "", "zeromq": "pyzmq", "helics-zmq": "helics", "helics-tcp": "helics"}
"""Distribution that a transport needs beyond our own dependencies."""

GRAPHS = {"full": full_graph, "ring": ring_graph}


class Extent(NamedTuple):
    """How much is measured: all of it for the page, a little in tests."""

    rounds: int = 5
    end: float | None = None
    """Duration (s) of our case instead of the experiment's 7 s."""
    mesh_rounds: int = 500
    runs: int = 80
    """Runs of the sweep."""
    sizes: Sequence[int] = (3, 9, 18, 30)
    """Numbers of agents as processes."""
    rings: Sequence[int] = (9, 30, 99, 300)
    full: Sequence[int] = (9, 18, 36, 72)
    """Numbers of agents in one process, in a ring and in a full graph."""
    ticks: int = 50
    """Ticks of a run of another size than nine."""
    hosted: tuple[int, int] = (100, 8)
    """Agents, and the processes that they share."""
    crowd: int = 300
    """More agents in as many processes; 0: none."""
    wall: int = 30
    """Agents as processes in wall-clock time."""
    many_ticks: int = 200
    """Ticks, of 0.1 s, of the runs of these two."""
    scale: Sequence[tuple[int, int]] = SCALE
    """Numbers of agents in a new process, and T_c (ms)."""

    def fewer(self, rounds: int) -> int:
        """Return at most so many rounds, for what takes long."""
        return min(self.rounds, rounds)


SHORT = Extent(
    rounds=1,
    end=0.2,
    mesh_rounds=5,
    runs=2,
    sizes=(3,),
    rings=(9,),
    full=(),
    ticks=5,
    hosted=(4, 2),
    crowd=0,
    wall=2,
    many_ticks=5,
    scale=((9, 100),),
)
"""As much as a test needs."""


class BenchPart(NamedTuple):
    """One part of the bench, whose measures take turns."""

    measures: Callable[[Extent], Sequence[Measure]]
    text: str
    """For the help."""
    usual: float
    """Duration (s) on an idle machine, where no former run tells it."""


def plant(extent: Extent) -> list[Measure]:
    """Our plant beside GridLAB-D."""
    case = OurCase(extent.end)
    case.plant_alone()  # loads the compiled step
    return [
        Measure("our plant", case.plant_alone, values=("ours.plant.build", "ours.plant.steps")),
        Measure("GridLAB-D", case.gridlabd_alone, "gridlabd", values=("gridlabd.plant.steps",)),
    ]


def case(extent: Extent) -> list[Measure]:
    """One case in process, its parts, and a sweep."""
    ours = OurCase(extent.end)
    ours.in_process()

    def parts() -> Mapping[str, float]:
        return {f"share.{name}": value for name, value in ours.shares().items()}

    sweep = ("ours.sweep", "ours.sweep.whole")
    return [
        Measure("our case in process", ours.in_process, values=("ours.case.inprocess",)),
        Measure("its parts", parts),
        Measure("our sweep", partial(ours.sweep, extent.runs), "joblib", values=sweep),
    ]


def command(extent: Extent) -> list[Measure]:
    """The command in a process of its own: its help, and its first case with processes."""
    ours = OurCase(extent.end)
    ours.in_process()  # compiles the step on a clean clone: that would be in the first round alone
    times = tuple(f"ours.command.{name}" for name in ("first_row", "last_row", "end"))
    return [
        Measure("gridpeers run", partial(our_command.command_times, ours), values=times),
        Measure("gridpeers --help", our_command.help_time, values=("ours.help",)),
    ]


def tick(extent: Extent) -> list[Measure]:
    """A lock-step tick of nine agents beside HELICS, ZeroMQ and bare Zenoh on the same mesh."""
    ours = OurCase(extent.end)
    agents = [agent.name for agent in ours.agents]
    ours.with_processes()  # starts the servers that plant and agents are forked from

    def mesh(transport: str, processes: int) -> Mapping[str, float]:
        seconds = seconds_per_round(
            transport, full_graph(agents), rounds=extent.mesh_rounds, sizes=ours.sizes, processes=processes
        )
        return {f"{transport}.tick.{processes or len(agents)}": seconds}

    def rival(name: str, transport: str, processes: int = 0) -> Measure:
        value = f"{transport}.tick.{processes or len(agents)}"
        return Measure(name, partial(mesh, transport, processes), PACKAGE.get(transport, ""), values=(value,))

    def own(name: str, shared: int = 0) -> Measure:
        kind = shared or len(agents)
        values = tuple(f"ours.{value}.{kind}" for value in ("tick", "first_row", "case"))
        return Measure(name, partial(ours.with_processes, shared), values=values)

    return [
        own("ours, a process for each agent"),
        rival("bare Zenoh", "zenoh"),
        rival("bare Zenoh, the hub relays", "zenoh-star"),
        own("ours, three agents a process", 3),
        rival("bare Zenoh, three agents a process", "zenoh", 3),
        rival("bare Zenoh, three agents a process, the hub relays", "zenoh-star", 3),
        rival("ZeroMQ ipc", "zeromq"),
        rival("HELICS zmq", "helics-zmq"),
        rival("HELICS tcp", "helics-tcp"),
    ]


def agents(extent: Extent) -> list[Measure]:
    """A tick against the number of agents, a process each, beside bare Zenoh and ZeroMQ."""
    sizes = OurCase(extent.end).sizes

    def mesh(transport: str, graph: str, n: int) -> Mapping[str, float]:
        neighbours = GRAPHS[graph]([f"inv{i}" for i in range(n)])
        seconds = seconds_per_round(transport, neighbours, rounds=max(extent.mesh_rounds // 4, 5), sizes=sizes)
        return {f"{transport}.{graph}.{n}": seconds}

    measures = []
    for n in extent.sizes:
        rounds = extent.fewer(3)
        for graph in GRAPHS if n > 3 else ("full",):  # three in a ring are three in a full graph
            run = partial(our_scale.with_processes, n, graph, extent.ticks)
            measures.append(Measure(f"ours, {graph}, {n}", run, rounds=rounds))
            for transport in ("zenoh", "zeromq"):
                bare = partial(mesh, transport, graph, n)
                measures.append(Measure(f"{transport}, {graph}, {n}", bare, PACKAGE[transport], rounds))
    return measures


def links(extent: Extent) -> list[Measure]:
    """The cost of a message in one process, against the number of agents and of links."""
    return [
        Measure(
            f"in process, {graph}, {n}",
            partial(
                our_scale.in_process, n, graph, extent.ticks * max(4, 90 // n)
            ),  # the start is a part of a short run
            rounds=extent.fewer(3 if graph == "full" else 5),
            values=(f"inprocess.link.{graph}.{n}",),
        )
        for graph, sizes in (("ring", extent.rings), ("full", extent.full))
        for n in sizes
    ]


def scale(extent: Extent) -> list[Measure]:
    """Cost of a simulated second in one process, on a ring, up to 999 agents."""
    return [
        Measure(
            f"{n} agents in process, T_c {T_c_ms} ms",
            partial(our_hosts.simulated_second, n, T_c_ms / 1e3),
            values=(f"scale.{T_c_ms}.{n}.by_the_clock",),
        )
        for n, T_c_ms in extent.scale
    ]


def hosted(extent: Extent) -> list[Measure]:
    """Many agents: several a process in lock-step beside bare Zenoh, and a process each in wall-clock time."""
    sizes = OurCase(extent.end).sizes
    (few, processes), wall = extent.hosted, extent.wall

    def bare() -> Mapping[str, float]:
        ring = ring_graph([f"inv{i}" for i in range(few)])
        seconds = seconds_per_round("zenoh", ring, rounds=extent.mesh_rounds, sizes=sizes, processes=processes)
        return {f"zenoh.hosted.{few}": seconds}

    def own(n: int, rounds: int) -> Measure:
        values = tuple(f"ours.hosted.{n}.{name}" for name in ("tick", "per_second", "start"))
        run = partial(our_hosts.hosted, n, processes, extent.many_ticks)
        return Measure(f"ours, {n} agents in {processes} processes", run, rounds=rounds, values=values)

    return [
        own(few, extent.rounds),
        Measure(f"bare Zenoh, {few} agents in {processes} processes", bare, values=(f"zenoh.hosted.{few}",)),
        *([own(extent.crowd, extent.fewer(3))] if extent.crowd else ()),
        Measure(
            f"ours, {wall} agent processes in wall-clock time",
            partial(our_hosts.in_time, wall, extent.many_ticks),
            values=(f"ours.wall.{wall}.in_time",),
        ),
    ]


PARTS = {
    "plant": BenchPart(plant, "the plant beside GridLAB-D", 110),
    "case": BenchPart(case, "one case in process and its parts, a sweep", 70),
    "command": BenchPart(command, "the command's help, and its first case with processes", 25),
    "tick": BenchPart(tick, "a tick with processes beside HELICS, ZeroMQ, bare Zenoh; a case start to end", 100),
    "agents": BenchPart(agents, "a tick against the number of agents, as processes", 110),
    "links": BenchPart(links, "the cost of a message in one process against the number of links", 90),
    "scale": BenchPart(scale, "a simulated second in one process, up to 999 agents", 160),
    "hosted": BenchPart(hosted, "100 and 300 agents in 8 processes in lock-step, 30 processes in wall-clock time", 180),
}
