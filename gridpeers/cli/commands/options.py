"""Shared parts of the commands for live runs: options, the client to a run, and errors in one line."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

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


@dataclass(frozen=True)
class LiveRun:
    """The options by which a command finds a run, as typed."""

    run: Run = RUN
    connect: Connect = None
    wait: Wait = 5.0
    keys: Keys = None
    member: As = ""
    insecure: Insecure = False

    def client(self, *, meet_agents: bool = False, acts: bool = False) -> AbstractContextManager[RunClient]:
        """Yield a client to the run, whose plant is there; any error ends the command with one line.

        A command that `acts` changes something, which a viewer may not.
        """
        return _client(self, meet_agents=meet_agents, acts=acts)


def of_live_run(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the options of `LiveRun` in place of its parameter `live`."""
    own, options = (inspect.signature(it, eval_str=True).parameters for it in (command, LiveRun))

    @wraps(command)
    def called(**words: Any) -> None:
        command(live=LiveRun(**{name: words.pop(name) for name in options}), **words)

    with_options(called, [*(one for one in own.values() if one.name != "live"), *options.values()])
    return called


def with_options(command: Callable[..., None], parameters: list[inspect.Parameter]) -> None:
    """Have typer read a command as one with these parameters."""
    command.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    command.__annotations__ = {one.name: one.annotation for one in parameters}


@contextmanager
def _client(live: LiveRun, *, meet_agents: bool, acts: bool) -> Iterator[RunClient]:
    require({"zenoh": "the connection to a run"})
    with usage_errors():
        from gridpeers.scenarios.live.run_address import Access, check_wait
        from gridpeers.scenarios.live.run_client import RunClient
        from gridpeers.wire.trust.key_folder import COMMANDING

        check_wait(live.wait)
        roles: tuple[Role, ...] = COMMANDING if acts else ("operator", "viewer")
        where = address(live.run, live.connect, Access(live.keys, live.member, live.insecure), roles)
        with RunClient(where, meet_agents=meet_agents) as client:
            client.find_plant(live.wait)
            yield client


def address(run: str, connect: list[str] | None, access: Access, roles: tuple[Role, ...], name: str = "") -> RunAddress:
    """Return the address of a run, with the credentials for it; raise UsageError or KeysError if they do not fit."""
    from dataclasses import replace

    from gridpeers.scenarios.live.run_address import address_of, with_protocol

    where = address_of(run, connect)
    endpoints = tuple(with_protocol(text, keys=access.keys is not None, default=ENDPOINT) for text in where.connect)
    for text in endpoints:
        check_open("--connect", text, access)
    return replace(where, connect=endpoints, credentials=opened(access, roles, name), access=access)


def check_open(option: str, endpoint: str, access: Access) -> None:
    """Raise UsageError if an endpoint cannot be used with or without certificates."""
    from gridpeers.scenarios.live.run_address import UsageError, objection

    if wrong := objection(option, endpoint, keys=access.keys is not None, insecure=access.insecure):
        raise UsageError(wrong)


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
    from gridpeers.wire.trust.key_folder import KeysError

    bad_input = (ConfigurationError, ListenError, FolderError, KeysError, NobodyError, RefusedError, SessionError)
    try:
        yield
    except (*bad_input, UsageError) as error:
        fail([str(error)], BAD_INPUT)
