"""Many runs, such as a sweep's: in this process, or over all cores of this machine by joblib.

Ctrl-C is for the command alone: workers are started with SIGINT blocked, and ended when the command leaves. They write
nothing to the terminal: a run's error comes as its result.
"""

from __future__ import annotations

import os
import signal
import threading
import warnings
from collections.abc import Callable, Generator, Iterable
from multiprocessing import resource_tracker
from typing import Any, TypeVar

from gridpeers.wire.driver.machine import POSIX

T = TypeVar("T")

Task = Callable[..., T]

Calls = Iterable[tuple[Any, ...]]
"""Arguments of the task for each run, such as its number, its scenario and its case; taken as workers become free."""


class WorkersError(RuntimeError):
    """A worker has gone."""


def cores() -> int:
    from joblib import cpu_count

    return int(cpu_count())


def on_workers(runs: Calls, jobs: int, task: Task[T]) -> Generator[T, None, None]:
    """Do the runs in `jobs` processes; results come in any order, and closing the generator ends the workers early."""
    if jobs == 1:
        for call in runs:
            yield task(*call)
        return
    from joblib import parallel_config
    from joblib.externals.loky import get_reusable_executor

    with parallel_config(backend="loky", n_jobs=jobs, initializer=_prepare, initargs=(os.getpid(),)):
        try:
            yield from _parallel(runs, task)
        finally:
            get_reusable_executor(reuse=True).shutdown(wait=True, kill_workers=True)


def _parallel(runs: Calls, task: Task[T]) -> Generator[T, None, None]:
    from joblib import Parallel, delayed

    tasks = (delayed(task)(*call) for call in runs)
    resource_tracker.ensure_running()  # before, as it lets SIGINT through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}) if POSIX else set()
    try:
        # one run a batch: each result is kept at once
        results: Any = Parallel(return_as="generator_unordered", batch_size=1)(tasks)
    finally:
        if POSIX:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
    try:
        # not `yield from`, which would close the results, with a warning, before we can
        for done in results:  # noqa: UP028
            yield done
    except GeneratorExit:
        with warnings.catch_warnings(action="ignore"):  # joblib warns that results are lost, as they are meant to be
            results.close()
        raise
    except (OSError, RuntimeError) as error:  # joblib's TerminatedWorkerError is a BrokenProcessPool, a RuntimeError
        first = str(error).partition("\n")[0]
        raise WorkersError(f"a worker has gone ({type(error).__name__}: {first})") from error


def _prepare(parent: int) -> None:
    """Silence this worker, and end it when the command is killed: otherwise it would wait for minutes."""
    silence = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silence, 2)
    os.close(silence)

    def watch() -> None:
        while os.getppid() == parent:
            threading.Event().wait(1.0)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
