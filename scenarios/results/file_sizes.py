"""Size of the files that a run will write, known before it starts, and whether its disk has room for them."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import NamedTuple

from agents.graphs import GraphError
from agents.topology import in_neighbours
from netem.schema.pattern import Link
from plant.equipment import Feeder
from scenarios.results.record import QUANTITIES
from scenarios.results.run_files import FolderError, shown
from scenarios.schema import ScenarioModel
from scenarios.schema.configs import configs
from scenarios.schema.netem_tables import netem_of, setup_of
from scenarios.schema.participants import inverters_of, with_agent
from wire.messages import PLANT

NUMBER = 18
"""Bytes of a number in history.csv with its comma: 17.5 measured over 600 s of islanding."""

VERDICT, VERDICT_UNDER_WAY = 36, 26
"""Bytes of a message's row in links.csv, and in the file of the case that gives way to it."""

LONG = 20_000_000
"""Bytes from which on a run's size is told before its start."""

HOUR = 3600.0
"""Run time (s) for which the size of a live run without an end is told."""

MB = 1e6


class FileSizes(NamedTuple):
    """Files of a run (bytes)."""

    history: int
    """All history.csv."""
    links: int
    """All links.csv."""
    room: int
    """The most that the run takes on the disk at one time."""

    @property
    def sentence(self) -> str:
        """Sentence on a long run's size; "" for others.

        Examples
        --------
        >>> FileSizes(history=60_000_000, links=0, room=60_000_000).sentence
        'writes about 60 MB: history.csv 60 MB'
        >>> FileSizes(history=1_000_000, links=0, room=1_000_000).sentence
        ''
        """
        if self.history + self.links < LONG:
            return ""
        links = f", links.csv {self.links / MB:.0f} MB" if self.links else ""
        return f"writes about {(self.history + self.links) / MB:.0f} MB: history.csv {self.history / MB:.0f} MB{links}"


def file_sizes(scenario: ScenarioModel, feeder: Feeder, seconds: float | None = None) -> FileSizes:
    """Return the size of the files of all cases of a scenario, which last for their own or other `seconds`.

    Links count where a fault may act on them, each with a message a tick.
    """
    time, end = scenario.time, scenario.time.end_s if seconds is None else seconds
    rows, ticks = round(end / time.record_s) + 1, round(end / time.T_c_s)
    history = links = most = 0
    for case in scenario.cases:
        history += rows * (1 + len(QUANTITIES) * len(inverters_of(scenario, feeder))) * NUMBER
        messages = ticks * _impaired_links(scenario, feeder, case)
        links += messages * VERDICT
        most = max(most, messages * VERDICT_UNDER_WAY)
    return FileSizes(history, links, history + links + most)


def require_room(folder: Path, sizes: FileSizes, option: str = "folder") -> None:
    """Refuse a folder whose disk has not the room for a run.

    Raises
    ------
    FolderError
        With the room that is needed and that there is; `option` names the other folder to be given.
    """
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


def _impaired_links(scenario: ScenarioModel, feeder: Feeder, case: str) -> int:
    """Return the number of links that carry messages in a case and on which a fault may act."""
    setup = setup_of(netem_of(scenario, case), scenario, feeder, real_nodes=False)
    netem = setup.netem
    if not (netem.links or netem.partitions):
        return 0
    members = {row.name: row for row in with_agent(scenario, feeder, case)}
    _, agents = configs(scenario, feeder, case)
    used = [link for name in members for link in (Link(PLANT, name), Link(name, PLANT))]
    for agent in agents:
        if agent.name not in members:
            continue
        try:
            heard = in_neighbours(agent.control, agent.name, members)
        except GraphError:
            heard = tuple(other for other in members if other != agent.name)
        used += [Link(other, agent.name) for other in heard]
    return sum(bool(netem.spans(link, setup.microgrids)) for link in used)
