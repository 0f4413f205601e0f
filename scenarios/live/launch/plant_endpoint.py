"""The endpoint of a plant that is to start: a free one, and no plant of its run is there already."""

from __future__ import annotations

from gridpeers.scenarios.drivers.free_endpoint import ListenError, free_endpoint
from gridpeers.scenarios.live.client.access import Access
from gridpeers.scenarios.live.client.run_address import (
    RUN,
    RunAddress,
    UsageError,
    accepting,
    check_endpoint,
    loopback_of,
    next_port,
)
from gridpeers.scenarios.live.client.run_client import RunClient
from gridpeers.wire.driver.command_line import command_line
from gridpeers.wire.trust.credentials import Credentials

LOOKING = 1.5
"""Time (s) to find a plant that is there: a link, and a token on it, take some 50 ms."""


def endpoint_for_run(listen: str, credentials: Credentials | None = None, access: Access | None = None) -> str:
    """Return the endpoint where a plant will be able to listen, a free port for port 0.

    Parameters
    ----------
    listen : str
        The endpoint.
    credentials : Credentials or None, optional
        The plant's, to ask another run that is there for its name.
    access : Access or None, optional
        The options that gave them, for the commands that the error names.

    Raises
    ------
    UsageError
        If it is no endpoint, or another run is there, which the message names.
    ListenError
        If it cannot be listened on.
    """
    try:
        return free_endpoint(check_endpoint("--listen", listen), option="--listen")
    except ListenError as error:
        where = loopback_of(listen)
        there = runs_at(where, credentials) if error.in_use and accepting((where,)) else []
        if not there:
            raise
        found_by = RunAddress(run=there[0], connect=(where,), access=access or Access()).words
        status, down = command_line("status", *found_by), command_line("down", *found_by)
        beside = next_port(listen)
        other = loopback_of(beside)
        raise UsageError(
            f"--listen: {' and '.join(f'run {name}' for name in there)} is there already, at {where}; "
            f"{status} shows it, {down} ends it; to have both, give this one a name and "
            f"a port of its own (--run NAME --listen {beside}; its other commands --run NAME --connect {other})"
        ) from None


def runs_at(endpoint: str, credentials: Credentials | None = None) -> list[str]:
    """Return the names of the runs whose plants are at an endpoint, as far as they show within `LOOKING` seconds."""
    with RunClient(RunAddress(run=RUN, connect=(endpoint,), credentials=credentials)) as client:
        client.until(lambda: bool(client.runs), LOOKING)
        return sorted(client.runs)


def check_alone(
    run: str, beyond: tuple[str, ...], credentials: Credentials | None = None, access: Access | None = None
) -> None:
    """Raise UsageError if a plant of this run is there already, beyond the own endpoint.

    Parameters
    ----------
    run : str
        Name of the run.
    beyond : tuple[str, ...]
        Endpoints that the plant will connect to; without any, it cannot meet another plant.
    credentials : Credentials or None, optional
        The plant's.
    access : Access or None, optional
        The options that gave them, for the command that the error names.
    """
    if not beyond:
        return
    there = RunAddress(run=run, connect=beyond, credentials=credentials, access=access or Access())
    with RunClient(there) as client:
        if client.until(lambda: client.plant, LOOKING):
            raise UsageError(
                f"--run: a plant of run {run} is there already, at {', '.join(beyond)}; end it "
                f"({command_line('down', *there.words)}), or give this run another name"
            )
