"""Size of the files that a run will write, known before it starts, and whether its disk has room for them."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from gridpeers.agents.graphs import GraphError, in_neighbours
from gridpeers.netem.schema.pattern import Link
from gridpeers.plant.equipment import InverterRow, Tables
from gridpeers.scenarios.results.case_tables import QUANTITIES
from gridpeers.scenarios.results.metrics_file import Clock
from gridpeers.scenarios.results.run_files import FolderError, shown
from gridpeers.scenarios.schema import ScenarioModel
from gridpeers.scenarios.schema.configs import configs
from gridpeers.scenarios.schema.participants import inverters_of, netem_of, setup_of, with_agent
from gridpeers.wire.messages import PLANT

NUMBER = 18  # Bytes of a number in history.csv with its comma: 17.5 measured over 600 s of islanding
VERDICT = 36  # Bytes of a message's row in links.csv
RECORDED_NUMBER = 6  # Bytes of a number of telemetry in run.mcap, compressed: 5.2 to 7.5 measured

RECORDED_DECISION = {"simulated": 75, "wall": 150}
"""Bytes of a decision in run.mcap with its measurement and its state, compressed, by kind of time: 50 (75 in one
process) and 135 measured."""

RECORDED_ARRIVAL, RECORDED_VERDICT = 9, 8
"""Bytes of a message that arrives in real time, and of a verdict of an emulated link: 7.7 and 3 to 9 found."""

LONG = 20_000_000  # Bytes from which on a run says its size before it starts
HOUR = 3600.0  # Run time (s) for which a live run without an end says its size
MB = 1e6


class FileSizes(NamedTuple):
    """Files of a run (bytes)."""

    history: int
    links: int
    record: int
    room: int
    """The most that the run takes on the disk at one time."""

    @property
    def sentence(self) -> str:
        """Sentence on a long run's size; "" for others."""
        whole = self.history + self.links + self.record
        if whole < LONG:
            return ""
        links = f", links.csv {self.links / MB:.0f} MB" if self.links else ""
        parts = f"history.csv {self.history / MB:.0f} MB{links}, run.mcap {self.record / MB:.0f} MB"
        return f"writes about {whole / MB:.0f} MB: {parts}"


def file_sizes(
    scenario: ScenarioModel, feeder: Tables, seconds: float | None = None, clock: Clock = "simulated"
) -> FileSizes:
    """Return the size of the files of all cases of a scenario, which last for their own or other `seconds`.

    Links count where a fault may act on them, each with a message a tick. A record is compressed: what it takes depends
    on the run, by a third or so.
    """
    time, end = scenario.time, scenario.time.end_s if seconds is None else seconds
    ticks = round(end / time.T_c_s)
    numbers = (round(end / time.record_s) + 1) * (1 + len(QUANTITIES) * len(inverters_of(scenario, feeder)))
    links = record = most = 0
    for case in scenario.cases:
        agents = {row.name: row for row in with_agent(scenario, feeder, case)}
        setup = setup_of(netem_of(scenario, case), scenario, feeder, real_nodes=False)
        arrivals, faults = clock == "wall" and scenario.record == "all", setup.netem.links or setup.netem.partitions
        used = _links_used(scenario, feeder, case, agents) if arrivals or faults else []
        messages = ticks * sum(bool(setup.netem.spans(link, setup.microgrids)) for link in used)
        links += messages * VERDICT
        most = max(most, messages * VERDICT)  # rows are sorted by link in another file first
        record += numbers * RECORDED_NUMBER
        if scenario.record != "physics":
            record += ticks * len(agents) * RECORDED_DECISION[clock] + messages * RECORDED_VERDICT
            record += ticks * len(used) * RECORDED_ARRIVAL if arrivals else 0
    history = len(scenario.cases) * numbers * NUMBER
    return FileSizes(history, links, record, history + links + record + most)


def _links_used(scenario: ScenarioModel, feeder: Tables, case: str, members: Mapping[str, InverterRow]) -> list[Link]:
    """Return the links that carry messages in a case; between agents all that are possible, by a graph that fails."""
    used = [link for name in members for link in (Link(PLANT, name), Link(name, PLANT))]
    for agent in configs(scenario, feeder, case)[1]:
        if agent.name in members:
            try:
                heard = in_neighbours(agent.control, agent.name, members)
            except GraphError:
                heard = tuple(other for other in members if other != agent.name)
            used += [Link(other, agent.name) for other in heard]
    return used


def require_room(folder: Path, sizes: FileSizes, option: str = "folder") -> None:
    """Raise FolderError if the disk of a folder lacks the room for a run; `option` names another folder."""
    there = next((each for each in (folder, *folder.absolute().parents) if each.exists()), Path())
    try:
        free = shutil.disk_usage(there).free
    except OSError:  # whoever writes there says why that cannot be done
        return
    if sizes.room > free:
        raise FolderError(
            f"{shown(folder)}: the run needs about {sizes.room / MB:.0f} MB, and its disk has {free / MB:.0f} MB left; "
            f"make room, give a folder on another disk by {option}, or write a larger record_s or fewer cases"
        )
