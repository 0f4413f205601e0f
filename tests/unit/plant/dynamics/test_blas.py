"""The limit that makes a run's last digits the same on every machine holds in every thread."""

from __future__ import annotations

from threading import Event, Thread

from threadpoolctl import threadpool_info, threadpool_limits

from gridpeers.plant.dynamics.threads import one_thread


def _threads() -> set[int]:
    return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}


def test_a_thread_that_is_through_does_not_lift_the_limit_under_another() -> None:
    """Runs in several threads of a notebook give the bytes that each gives alone; the last lifts the limit."""
    inside, leave = Event(), Event()

    def first() -> None:
        with one_thread():
            inside.set()
            leave.wait(100.0)

    with threadpool_limits(2, user_api="blas"):
        before = _threads()
        thread = Thread(target=first)
        thread.start()
        assert inside.wait(100.0)
        with one_thread():
            leave.set()
            thread.join()
            assert _threads() == {1}
        assert _threads() == before
