"""What does many runs does them on a Dask cluster, too, with the same results, and says when there is none."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

import gridpeers as gp
from gridpeers.scenarios.sweep import workers
from tests.command_line import invoke
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
