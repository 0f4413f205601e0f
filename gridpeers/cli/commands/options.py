"""Shared parts of the commands for live runs: options, the client to a run, and errors in one line."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gridpeers.cli.usage import BAD_INPUT, fail, require
from gridpeers.wire.keys import Role

if TYPE_CHECKING:
    from gridpeers.scenarios.live.run_address import Access, RunAddress
    from gridpeers.scenarios.live.run_client import RunClient
    from gridpeers.wire.trust.credentials import Credentials

RUN, ENDPOINT = "gridpeers", "tcp/127.0.0.1:7447"
"""The same as in `gridpeers.scenarios.live.run_address`; a test compares them."""

Run = Annotated[str, typer.Option("--run", metavar="NAME", help="Name of the run; runs of other names do not meet.")]
Connect = Annotated[
    list[str] | None,
    typer.Option("--connect", metavar="ENDPOINT", help=f"Where the plant listens, {ENDPOINT} if left out; repeatable."),
]
Wait = Annotated[float, typer.Option("--wait", metavar="SECONDS", help="Longest wait for the plant.")]
Keys = Annotated[
    Path | None,
    typer.Option("--keys", metavar="DIR", help="With certificates from here, links are TLS (docs/security.md)."),
]
As = Annotated[
    str, typer.Option("--as", metavar="NAME", help="With --keys: whose certificate; the operator's if left out.")
]
Insecure = Annotated[
    bool, typer.Option("--insecure", help="Let an endpoint be open to everybody who reaches it, beyond the loopback.")
]


@contextmanager
def run_client(
    run: str,
    connect: list[str] | None,
    wait: float,
    access: Access,
    *,
    meet_agents: bool = False,
    acts: bool = False,
) -> Iterator[RunClient]:
    """Yield a client to a run whose plant is there; any error ends the command with one line.

    Parameters
    ----------
    run, connect, wait
        The options of these names.
    access : Access
        The options on certificates.
    meet_agents : bool, optional
        Whether to connect to the agents too.
    acts : bool, optional
        Whether the command changes something, which a viewer may not.
    """
    require({"zenoh": "the connection to a run"})
    with usage_errors():
        from gridpeers.scenarios.live.run_address import check_wait
        from gridpeers.scenarios.live.run_client import RunClient
        from gridpeers.wire.trust.key_folder import COMMANDING

        check_wait(wait)
        where = address(run, connect, access, COMMANDING if acts else PEOPLE)
        with RunClient(where, meet_agents=meet_agents) as client:
            client.find_plant(wait)
            yield client


PEOPLE: tuple[Role, ...] = ("operator", "viewer")
"""Roles of commands."""


def address(run: str, connect: list[str] | None, access: Access, roles: tuple[Role, ...], name: str = "") -> RunAddress:
    """Return the address of a run, with the credentials for it; raise UsageError or KeysError if they do not fit."""
    from dataclasses import replace

    from gridpeers.scenarios.live.run_address import UsageError, address_of, objection, with_protocol

    where = address_of(run, connect)
    keys = access.keys is not None
    endpoints = tuple(with_protocol(text, keys=keys, default=ENDPOINT) for text in where.connect)
    for text in endpoints:
        if wrong := objection("--connect", text, keys=keys, insecure=access.insecure):
            raise UsageError(wrong)
    return replace(where, connect=endpoints, credentials=opened(access, roles, name), access=access)


def opened(access: Access, roles: tuple[Role, ...], name: str = "") -> Credentials | None:
    """Return the credentials of a command; say so if the certificate ends soon."""
    if access.keys is None:
        if access.name:
            from gridpeers.scenarios.live.run_address import UsageError

            raise UsageError("--as: chooses a certificate; say --keys DIR, too")
        return None
    require({"cryptography": "certificates"}, "install it: pip install 'gridpeers[keys]'")
    from gridpeers.wire.trust.key_folder import open_credentials

    credentials, note = open_credentials(access.keys, roles, name or access.name)
    if note:
        typer.echo(f"NOTE  {note}", err=True)
    return credentials


@contextmanager
def usage_errors() -> Iterator[None]:
    """End the command with one line and exit code 2 on a usage error, or if the run is not there."""
    from gridpeers.scenarios.drivers.free_endpoint import ListenError
    from gridpeers.scenarios.live.run_address import UsageError
    from gridpeers.scenarios.live.run_client import NobodyError
    from gridpeers.scenarios.live.run_requests import RefusedError
    from gridpeers.scenarios.results.run_files import FolderError
    from gridpeers.wire.driver.process import ConfigurationError
    from gridpeers.wire.driver.session import SessionError
    from gridpeers.wire.trust.certificate_files import KeysError

    try:
        yield
    except (
        ConfigurationError,
        ListenError,
        FolderError,
        KeysError,
        NobodyError,
        RefusedError,
        SessionError,
        UsageError,
    ) as error:
        fail([str(error)], BAD_INPUT)
