"""Shared parts of the commands for live runs: options, the client to a run, and errors in one line."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated

import typer

from gridpeers.cli.usage import BAD_INPUT, fail, require

if TYPE_CHECKING:
    from scenarios.live.run_client import RunClient

RUN, ENDPOINT = "gridpeers", "tcp/127.0.0.1:7447"
"""The same as in `scenarios.live.run_address`; a test compares them."""

Run = Annotated[str, typer.Option("--run", metavar="NAME", help="Name of the run; runs of other names do not meet.")]
Connect = Annotated[
    list[str] | None,
    typer.Option("--connect", metavar="ENDPOINT", help=f"Where the plant listens, {ENDPOINT} if left out; repeatable."),
]
Wait = Annotated[float, typer.Option("--wait", metavar="SECONDS", help="Longest wait for the plant.")]


@contextmanager
def run_client(run: str, connect: list[str] | None, wait: float, *, meet_agents: bool = False) -> Iterator[RunClient]:
    """Yield a client to a run whose plant is there; any error ends the command with one line."""
    require({"zenoh": "the connection to a run"})
    with usage_errors():
        from scenarios.live.run_address import address_of, check_wait
        from scenarios.live.run_client import RunClient

        check_wait(wait)
        with RunClient(address_of(run, connect), meet_agents=meet_agents) as client:
            client.find_plant(wait)
            yield client


@contextmanager
def usage_errors() -> Iterator[None]:
    """End the command with one line and exit code 2 on a usage error, or if the run is not there."""
    from scenarios.drivers.free_endpoint import ListenError
    from scenarios.live.run_address import UsageError
    from scenarios.live.run_client import NobodyError
    from scenarios.live.run_requests import RefusedError
    from scenarios.results.run_files import FolderError
    from wire.driver.process import ConfigurationError
    from wire.driver.session import SessionError

    try:
        yield
    except (
        ConfigurationError,
        ListenError,
        FolderError,
        NobodyError,
        RefusedError,
        SessionError,
        UsageError,
    ) as error:
        fail([str(error)], BAD_INPUT)
