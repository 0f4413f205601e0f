"""Which tests `pytest` leaves out as slow, and how `pytest -n` shares the others out.

Those that keep real time have one worker and the right of way.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path, PurePosixPath

import pytest
from xdist.scheduler import LoadFileScheduling
from xdist.workermanage import WorkerController

ROOT = Path(__file__).parents[1]

REAL_TIME = ("tests/processes/realtime",)
"""Folders of tests that keep real time: no two of them run at once, and what runs beside them gives way."""

IN_PROCESS = ("tests/unit", "tests/golden", "tests/papers", "tests/fuzz")
"""Folders of tests that start hardly a process. They come last on the other workers, as each is short."""

ONE_RUN = ("tests/golden/catalogue", "tests/papers/singhal2022", "tests/conformance/test_islands.py")
"""Tests that look at the same runs of the catalogue: one worker has them all, and runs each case once."""

EACH = ("tests/pages", "tests/validation")  # Tests that take seconds and share nothing: any worker has any of them

SLOW = {
    "tests/processes": "processes and real time",
    "tests/validation": "other simulators",
    "tests/conformance/test_gridlabd_plant.py": "GridLAB-D as the plant",
    "tests/conformance/laws": "carriers of laws",
    "tests/conformance/test_record.py": "records",
    "tests/conformance/test_replay.py": "replays",
    "tests/papers/experiments": "experiments on links",
    "tests/papers/reproduce": "reproduce",
    "tests/unit/bridges/opendss/test_opendss_process.py": "the process of OpenDSS",
    "tests/unit/gridpeers/test_own_law.py": "own laws with processes",
    "tests/unit/gridpeers/test_plugins_page.py": "distributions with plug-ins",
    "tests/unit/lab/communication/test_communication_checks.py": "accounts of messages",
    "tests/unit/scenarios/sweep/test_sweep_runs.py": "sweeps with workers",
    "tests/fuzz": "made-up messages",
    "tests/unit/lab/chaos/test_campaign.py": "campaigns of chaos",
    "tests/pages": "the pages",
    "tests/examples": "the examples",
    "tests/wheel": "the wheel",
    "tests/soak": "a soak",
    "tests/peers": "the benches",
    "tests/security": "intruders",
    "tests/resources": "floods and clocks that jump",
}
"""Tests that `pytest` leaves out unless they are named: `--all` runs them too, as .ci/run does."""

_GONE = [each for each in (*REAL_TIME, *IN_PROCESS, *ONE_RUN, *EACH, *SLOW) if not (ROOT / each).exists()]
assert not _GONE, f"no such tests: {_GONE}"


def leave_out_slow(items: list[pytest.Item]) -> list[pytest.Item]:
    """Take the slow tests out of the list, and return them."""
    left_out = [item for item in items if _within(item.nodeid.partition("::")[0], SLOW)]
    items[:] = [item for item in items if item not in set(left_out)]
    return left_out


class RealTimeApart(LoadFileScheduling):
    """The first worker has what keeps real time, and the third nothing that starts processes.

    Linux weighs each session of processes alone, whatever its niceness: the processes that a test starts take from
    those of a real-time test, and only tests without any give way.
    """

    def _split_scope(self, nodeid: str) -> str:
        file = super()._split_scope(nodeid)
        if _within(file, EACH):
            return nodeid
        return ONE_RUN[0] if _within(file, ONE_RUN) else str(file)

    def _assign_work_unit(self, node: WorkerController) -> None:
        real_time = [file for file in self.workqueue if _within(file, REAL_TIME)]
        in_process = [file for file in self.workqueue if _within(file, IN_PROCESS) or not _within(file, ("tests",))]
        others = [file for file in self.workqueue if file not in real_time and file not in in_process]
        workers = sorted(self.nodes, key=lambda each: int(each.gateway.id.removeprefix("gw")))
        choices = {0: real_time or others or in_process, 1: others or in_process}.get(workers.index(node), in_process)
        if choices:
            self.workqueue.move_to_end(choices[0], last=False)
            super()._assign_work_unit(node)
        else:
            node.shutdown()


def _within(file: str, folders: Iterable[str]) -> bool:
    return any(PurePosixPath(file.partition("::")[0]).is_relative_to(folder) for folder in folders)


def compile_once() -> None:
    """Compile the plant's inner loops in a fresh clone, before several processes do it side by side."""
    from msgspec.structs import replace

    from gridpeers.plant.build import build_plant
    from gridpeers.scenarios.schema import load_scenario
    from gridpeers.scenarios.schema.configs import configs

    config, _ = configs(*load_scenario("islanding"), "I")
    build_plant(config)
    build_plant(replace(config, settings=replace(config.settings, method="second-order")))


def give_way() -> None:
    """Have this worker and all processes it starts run only where the first worker leaves room."""
    if os.environ.get("PYTEST_XDIST_WORKER", "gw0") != "gw0":
        os.nice(19)
