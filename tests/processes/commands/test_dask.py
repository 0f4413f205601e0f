"""What does many runs does them on a Dask cluster, too, with the same results, and says when there is none."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path

import msgspec
import pytest

import gridpeers as gp
from gridpeers.lab.chaos.campaign import Campaign, run_campaign
from gridpeers.lab.chaos.chaos_folder import ChaosFolder
from gridpeers.lab.chaos.chaos_run import ChaosRow
from gridpeers.scenarios.sweep import workers
from tests.command_line import invoke
from tests.unit.lab.chaos.bases import base_in
from tests.unit.lab.chaos.small_campaign import small

SHORT = {"time.end_s": 1.5, "event": [{"label": "event1", "t_s": 1.0, "open": ["13-152"]}], "paper": ""}


@pytest.fixture(scope="module")
def scheduler() -> Iterator[str]:
    """Address of a scheduler on the loopback with two worker processes."""
    from distributed import LocalCluster

    with LocalCluster(  # type: ignore[no-untyped-call]
        n_workers=2, threads_per_worker=1, processes=True, host="127.0.0.1", protocol="tcp", dashboard_address=":0"
    ) as cluster:
        yield cluster.scheduler_address


def test_a_sweep_in_python_gives_the_table_of_this_machine(scheduler: str) -> None:
    """With the histories of its runs."""
    base, grid = gp.load("islanding").replace(SHORT), {"gains.k_p": [0.0005, 0.001]}

    there = gp.sweep(base, grid, cases="IV", histories=True, dask=scheduler)
    here = gp.sweep(base, grid, cases="IV", histories=True, jobs=1)

    assert there.drop(columns="history").equals(here.drop(columns="history"))
    assert all(a.equals(b) for a, b in zip(there["history"], here["history"], strict=True))


def test_a_campaign_of_chaos_gives_the_runs_of_this_machine(scheduler: str, tmp_path: Path) -> None:
    """Their schedules, verdicts and bytes, and the failures that they are shrunk to."""
    base = base_in(small(tmp_path))

    def rows(name: str, dask: str) -> tuple[dict[int, ChaosRow], list[ChaosRow]]:
        (tmp_path / name).mkdir()
        folder = ChaosFolder(tmp_path / name, base, 3, "gridpeers chaos small")
        done = run_campaign(
            Campaign(base=base, seed=3, runs=2, dask=dask), folder, lambda of: nullcontext(lambda what, done: None)
        )
        untimed = {n: msgspec.structs.replace(row, took_s=0.0) for n, row in done.rows.items()}
        return untimed, [msgspec.structs.replace(it.simplest, took_s=0.0) for it in done.failures]

    assert rows("there", scheduler) == rows("here", "")


@pytest.mark.parametrize("words", [("experiment", "topology"), ("chaos", "small.toml")])
def test_no_scheduler_at_the_address_is_told(
    words: tuple[str, ...], elsewhere: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Exit code 3, and how to start a cluster."""
    monkeypatch.setattr(workers, "DASK_PATIENCE", 0.2)
    small(elsewhere)

    code, text = invoke(*words, "--dask", "tcp://127.0.0.1:1")

    assert (code, "--dask tcp://127.0.0.1:1: no Dask scheduler answers there" in text) == (3, True), text


def test_what_a_cluster_cannot_do_is_refused(elsewhere: Path) -> None:
    """Runs with processes, an experiment of one run, and an address that is none."""
    small(elsewhere)
    chaos = invoke("chaos", "small.toml", "--driver", "processes", "--dask", "tcp://127.0.0.1:1")
    alone = invoke("experiment", "partition", "--dask", "tcp://127.0.0.1:1")

    assert (chaos[0], "--dask: its workers run each run in one process" in chaos[1]) == (2, True), chaos
    assert (alone[0], "--dask: goes with the experiments that are sweeps" in alone[1]) == (2, True), alone
    with pytest.raises(gp.ScenarioError, match="dask: must be the address of a scheduler"):
        gp.sweep("islanding", {"gains.k_p": [0.001]}, dask=8786)  # type: ignore[arg-type]
