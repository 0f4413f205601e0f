"""How `pytest -n` shares the tests out: those that keep real time have one worker and the right of way."""

from __future__ import annotations

import os
from pathlib import PurePosixPath

from xdist.scheduler import LoadFileScheduling
from xdist.workermanage import WorkerController

REAL_TIME = ("tests/processes", "tests/schedules", "tests/netem_relay")
"""Folders of tests that keep real time: no two of them run at once, and what runs beside them gives way."""


class RealTimeApart(LoadFileScheduling):
    """A file of tests goes to any worker that is free, but one that keeps real time to the first worker alone."""

    def _assign_work_unit(self, node: WorkerController) -> None:
        real_time = [file for file in self.workqueue if _keeps_real_time(file)]
        others = [file for file in self.workqueue if not _keeps_real_time(file)]
        first = min(self.nodes, key=lambda each: int(each.gateway.id.removeprefix("gw")))
        choices = real_time or others if node is first else others
        if choices:
            self.workqueue.move_to_end(choices[0], last=False)
            super()._assign_work_unit(node)
        else:
            node.shutdown()


def _keeps_real_time(file: str) -> bool:
    return any(PurePosixPath(file).is_relative_to(folder) for folder in REAL_TIME)


def give_way() -> None:
    """Have this worker and all processes it starts run only where the first worker leaves room."""
    if os.environ.get("PYTEST_XDIST_WORKER", "gw0") != "gw0":
        os.nice(19)
