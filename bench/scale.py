"""Cost of agents in one process against their number: joined copies of a feeder, islanded, on three graphs.

For each number of agents (nine a copy of `microgrid123`) and each graph: processor time per simulated second, split
at the plant's interface; of it the part that is not the plant's, per agent and tick and per message; memory. Messages
are one a link, and one from and to the plant an agent.
Each is the least of several rounds, in which the graphs take turns. Of real time are processor time and, as the plant
steps many islands on all cores, time by the clock: below 1 is faster than real time.
The copies are tied to each other and make one island, or with `--apart 1` an island each.

    .venv/bin/python -m bench.scale [--agents 9,27,99,306,999] [--T_c 0.1] [--end 4] [--rounds 3] [--apart 0]
                                    [--graphs ring,clustered,full] [--json scale.json]

The part `scale` of `bench.peers` runs it on a ring, for the table and the figure of docs/performance.md.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from time import perf_counter, process_time
from typing import Any
from unittest.mock import patch

from agents.graphs import RosterGraph
from agents.topology import rule_of
from bench.harness import load, machine, options, say
from gridpeers.feeder import Feeder
from plant.build import build_plant
from plant.equipment.joined_copies import copy_name, joined_copies
from plant.feeder import Plant
from plant.plant_config import PlantConfig
from scenarios.drivers.inprocess import run_inprocess
from scenarios.results.record import Recorder
from scenarios.schema import load_scenario
from scenarios.schema.configs import configs

ISLAND, JOINT = 9, "450"
"""Inverters of the feeder `microgrid123`, and its bus at which copies are joined."""

GRAPHS = ("ring", "clustered", "full")

MOST_FULL, MOST_CLUSTERED = 99, 306
"""Most agents on a graph whose links grow with the square of their number."""

AGENT_SECONDS = 600
"""Least agents times simulated seconds (s): with fewer, a run is over too soon to say anything."""

SCENARIO = """\
name = "scale"
[plant]
feeder = "grown"
[time]
T_c_s = {T_c}
end_s = {end}
[[event]]
label = "islanding"
t_s = {islanding}
open = {switches}
"""

CASE = '[case.{graph}]\nsecondary = "all"\ngraph = "{graph}"\n'


class PlantClock:
    """Processor time (s) spent in the plant."""

    def __init__(self) -> None:
        self.spent = 0.0

    def timed(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return the function with its time counted."""

        def call(*arguments: Any, **named: Any) -> Any:
            began = process_time()
            try:
                return function(*arguments, **named)
            finally:
                self.spent += process_time() - began

        return call


def write_scenario(folder: Path, agents: int, T_c: float, end: float, graphs: Sequence[str], *, apart: bool) -> Path:
    """Write a feeder of joined copies and its scenario; return the scenario's path."""
    copies = agents // ISLAND
    joined_copies(Feeder.read("microgrid123"), copies, JOINT).save(folder / "grown")
    switches = [f"{copy_name('13', k)}-{copy_name('152', k)}" for k in range(1, copies + 1)]
    switches += [f"tie_{k}" for k in range(2, copies + 1) if apart]
    text = SCENARIO.format(T_c=T_c, end=end, islanding=1.0, switches=json.dumps(switches))
    path = folder / "scale.toml"
    path.write_text(text + "".join(CASE.format(graph=graph) for graph in graphs), encoding="utf-8")
    return path


def graphs_of(agents: int, wanted: str) -> tuple[str, ...]:
    """Return the graphs to run with so many agents, of those that are wanted; with none of them left, the ring."""
    most = {"full": MOST_FULL, "clustered": MOST_CLUSTERED}
    return tuple(graph for graph in wanted.split(",") if agents <= most.get(graph, agents)) or GRAPHS[:1]


def megabytes() -> float:
    """Return the largest size of this process so far (MB)."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1e6 if sys.platform == "darwin" else 1e3)


def measure(
    agents: int, T_c: float, end: float, rounds: int, graphs: Sequence[str], *, apart: bool
) -> Iterator[dict[str, float | str]]:
    """Yield one row for each graph; the plant's code is compiled, or loaded, before the first."""
    with tempfile.TemporaryDirectory() as text:
        folder = Path(text)
        path = write_scenario(folder, agents, T_c, end, graphs, apart=apart)
        began = process_time()
        scenario, feeder = load_scenario(str(path))
        read = process_time() - began
        plant, agent_configs = configs(scenario, feeder, graphs[0])
        built = build_plant(plant)
        if agents <= MOST_FULL:  # the first run of a process is slower, which shows in few agents
            timed_run(plant, agent_configs, built, folder / "first")
        best: dict[str, dict[str, float]] = {}
        for number in range(rounds):
            for graph in scenario.cases:
                plant, agent_configs = configs(scenario, feeder, graph)
                began = process_time()
                built = build_plant(plant)
                build_s = process_time() - began
                row = timed_run(plant, agent_configs, built, folder / f"{graph}{number}") | {"build_s": build_s}
                best[graph] = {name: min(value, best.get(graph, row)[name]) for name, value in row.items()}
        for graph, row in best.items():
            _, agent_configs = configs(scenario, feeder, graph)
            members = {config.name: config for config in agent_configs}
            edges = RosterGraph(rule_of(agent_configs[0].control), members, graph)
            links = sum(len(edges.in_neighbours(name)) for name in members)
            own, ticks = row["agents_s"], end / T_c
            yield {
                "agents": agents,
                "graph": graph,
                "links": links,
                "T_c_s": T_c,
                "end_s": end,
                "read_s": read,
                "build_s": row["build_s"],
                "meet_s": row["meet"],
                "plant_per_s": row["plant_s"] / end,
                "agents_per_s": own / end,
                "of_real_time": (own + row["plant_s"]) / end,
                "by_the_clock": row["clock_s"] / end,
                "us_per_agent_and_tick": 1e6 * own / agents / ticks,
                "us_per_message": 1e6 * own / (links + 2 * agents) / ticks,
                "memory_MB": megabytes(),
                "load": load(),
            }


def timed_run(plant: PlantConfig, agents: Any, built: Plant, folder: Path) -> dict[str, float]:
    """Run one case in this process and record it; return its times (s).

    Returns
    -------
    dict
        Processor time until the first row (`meet`), and from there on: of the plant at its interface (`plant_s`), of
        all else (`agents_s`), and the time by the clock (`clock_s`).
    """
    assert plant.end is not None
    clock = PlantClock()
    first: list[tuple[float, float, float]] = []
    with ExitStack() as stack:
        for name in ("advance", "measure", "hold", "take_rows"):
            stack.enter_context(patch.object(Plant, name, clock.timed(getattr(Plant, name))))
        recorder = stack.enter_context(Recorder(folder))

        def take(telemetry: Any) -> None:
            if not first:
                first.append((process_time(), clock.spent, perf_counter()))
            recorder(telemetry)

        began = process_time()
        outcome = run_inprocess(plant, agents, take, plant=built)
        ended, spent, then = process_time(), clock.spent, perf_counter()
        recorder.finish(plant.end, plant.record_step)
    assert not outcome.broke, outcome.broke
    at, before, since = first[0]
    plant_s = spent - before
    return {"meet": at - began, "plant_s": plant_s, "agents_s": ended - at - plant_s, "clock_s": then - since}


def main() -> None:
    """Measure each number of agents in a process of its own, print a table, write JSON."""
    numbers: dict[str, float | str] = {"agents": "9,27,99,306,999", "T_c": 0.1, "end": 4, "rounds": 3, "apart": 0}
    given = options(__doc__, **numbers, graphs=",".join(GRAPHS), json="", only=0)
    if unknown := [graph for graph in given.graphs.split(",") if graph not in GRAPHS]:
        sys.exit(f'graph "{unknown[0]}": there is no such graph; choose from {", ".join(GRAPHS)}')
    if given.only:  # the child: one number of agents, so that memory is its own
        graphs = graphs_of(given.only, given.graphs)
        found = measure(given.only, given.T_c, float(given.end), given.rounds, graphs, apart=bool(given.apart))
        print(json.dumps(list(found)))
        return
    print(machine())
    rows: list[dict[str, Any]] = []
    for agents in map(int, given.agents.split(",")):
        say(f"{agents} agents")
        end = max(given.end, round(AGENT_SECONDS / agents))
        words = ["--only", str(agents), "--T_c", str(given.T_c), "--end", str(end)]
        words += ["--rounds", str(given.rounds), "--apart", str(given.apart), "--graphs", given.graphs]
        child = subprocess.run([sys.executable, "-m", "bench.scale", *words], stdout=subprocess.PIPE, check=True)
        rows += json.loads(child.stdout)
    names = [name for name in rows[0] if name not in ("graph", "load", "T_c_s")]
    print(f"T_c {given.T_c:g} s, processor time")
    print("graph    " + "".join(f"  {name}" for name in names))
    for row in rows:
        print(f"{row['graph']:9}" + "".join(f"  {row[name]:>{len(name)}.5g}" for name in names))
    if given.json:
        Path(given.json).write_text(json.dumps({"machine": machine(), "rows": rows}, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
