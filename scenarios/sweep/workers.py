"""The runs of a sweep over all cores of this machine, or over a Dask cluster: the same tasks through joblib.

Ctrl-C is for the command alone: workers of this machine are started with SIGINT blocked, and they are ended when the
command leaves. What they and their helpers would write over the terminal at such an end is left out: a run's error
comes as its result.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, TypeVar, overload

from joblib import Parallel, cpu_count, delayed, parallel_config
from joblib.externals.loky import get_reusable_executor

from scenarios.schema import ScenarioModel
from scenarios.sweep.file import Run
from scenarios.sweep.sweep_case import SweepRow, run_one

T = TypeVar("T")

Task = Callable[[int, ScenarioModel, str], T]
"""Does one run: its number, its scenario, its case."""

_WARNINGS = "PYTHONWARNINGS"

DASK_PATIENCE = 10.0
"""Longest wait for a scheduler, and for its first worker (s)."""


class WorkersError(RuntimeError):
    """The workers cannot be had, or have gone."""


def cores() -> int:
    """Return the cores that this process may use."""
    return int(cpu_count())


@overload
def on_this_machine(runs: Sequence[tuple[int, Run]], jobs: int) -> Generator[SweepRow, None, None]: ...
@overload
def on_this_machine(runs: Sequence[tuple[int, Run]], jobs: int, task: Task[T]) -> Generator[T, None, None]: ...
def on_this_machine(
    runs: Sequence[tuple[int, Run]], jobs: int, task: Task[Any] = run_one
) -> Generator[Any, None, None]:
    """Do the runs in `jobs` processes; each comes back as soon as it is done, in whatever order.

    Close the iterator to end the workers early.
    """
    if jobs == 1:
        for number, run in runs:
            yield task(number, run.scenario, run.case)
        return
    with parallel_config(backend="loky", n_jobs=jobs, initializer=_prepare, initargs=(os.getpid(),)):
        try:
            yield from _parallel(runs, task)
        finally:
            get_reusable_executor(reuse=True).shutdown(wait=True, kill_workers=True)


def on_dask(runs: Sequence[tuple[int, Run]], address: str) -> Generator[SweepRow, None, None]:
    """Do the runs on a Dask cluster, whose workers need the same gridpeers and the feeders' folders.

    Raises
    ------
    WorkersError
        If there is no scheduler at the address, or it has no worker.
    """
    from distributed import Client

    connect: Any = Client  # it has no types

    try:
        client: Any = connect(address, timeout=DASK_PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise WorkersError(
            f"--dask {address}: no Dask scheduler answers there ({type(error).__name__}); start one by `dask "
            "scheduler`, workers by `dask worker ADDRESS`, and give its address, e.g. tcp://127.0.0.1:8786"
        ) from None
    with client, parallel_config(backend="dask", client=client, wait_for_workers_timeout=DASK_PATIENCE):
        try:
            yield from _parallel(runs, run_one)
        except TimeoutError:
            raise WorkersError(f"--dask {address}: the scheduler has no worker; start some by `dask worker`") from None


def _parallel(runs: Sequence[tuple[int, Run]], task: Task[T]) -> Generator[T, None, None]:
    tasks = (delayed(task)(number, run.scenario, run.case) for number, run in runs)
    with _without_interrupts():
        # one run a batch: what is done is kept at once
        results: Any = Parallel(return_as="generator_unordered", batch_size=1)(tasks)
    try:
        # not `yield from`, which would close the results, with a warning, before we can
        for done in results:  # noqa: UP028
            yield done
    except GeneratorExit:
        _close(results)
        raise
    except (OSError, RuntimeError) as error:  # joblib's TerminatedWorkerError is a BrokenProcessPool, a RuntimeError
        first = str(error).partition("\n")[0]
        raise WorkersError(f"a worker has gone ({type(error).__name__}: {first})") from error


def _close(results: Any) -> None:
    """End the dispatch; joblib warns that results are lost, which is what was asked for."""
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        results.close()


@contextmanager
def _without_interrupts() -> Iterator[None]:
    """Hold Ctrl-C back in this thread and in what it starts; one that came meanwhile comes after.

    The tracker of the workers' semaphores, started here too, else warns of those of workers that were ended.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    warnings = os.environ.get(_WARNINGS)
    os.environ[_WARNINGS] = ",".join(filter(None, [warnings, "ignore:resource_tracker:UserWarning"]))
    try:
        yield
    finally:
        if warnings is None:
            del os.environ[_WARNINGS]
        else:
            os.environ[_WARNINGS] = warnings
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _prepare(parent: int) -> None:
    """Have this worker be silent, and end when the command is killed: nobody else would end it, for minutes."""
    silence = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silence, 2)
    os.close(silence)

    def watch() -> None:
        while os.getppid() == parent:
            threading.Event().wait(1.0)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
