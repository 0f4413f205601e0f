"""Shared parts of the commands for live runs: options, the client to a run, and errors in one line."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gridpeers.cli.usage import BROKEN, CLAIM_FAILED, INTERRUPTED, TERMINATED, fail, flag, option
from gridpeers.scenarios.live.run_address import (
    ENDPOINT,
    RUN,
    Access,
    RunAddress,
    UsageError,
    address_of,
    check_wait,
    objection,
    with_protocol,
)
from gridpeers.wire.keys import Role
from gridpeers.wire.trust.credentials import Credentials
from gridpeers.wire.trust.key_folder import COMMANDING, open_credentials

if TYPE_CHECKING:
    from gridpeers.scenarios.live.live_processes import ProcessOutcome
    from gridpeers.scenarios.live.run_client import RunClient

Run = Annotated[str, option("NAME", "Name of the run; runs of other names do not hear each other.")]
Connect = Annotated[list[str] | None, option("ENDPOINT", f"Endpoint of the plant, {ENDPOINT} if left out; repeatable.")]
Wait = Annotated[float, option("SECONDS", "Longest wait for the plant.")]
Keys = Annotated[
    Path | None, option("DIR", "Folder with certificates; links are then TLS (docs/how-to/several-hosts.md).")
]
As = Annotated[str, option("NAME", "With --keys, the member whose certificate is used; operator if left out.", "--as")]
Insecure = Annotated[
    bool, flag("Allow an unencrypted endpoint beyond the loopback, open to everybody who reaches it.", "--insecure")
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

    @contextmanager
    def client(self, *, meet_agents: bool = False, acts: bool = False) -> Iterator[RunClient]:
        """Yield a client to the run once its plant is there; one that `acts` changes something, which no viewer may."""
        from gridpeers.scenarios.live.run_client import RunClient  # the help does without a session

        check_wait(self.wait)
        roles: tuple[Role, ...] = COMMANDING if acts else ("operator", "viewer")
        where = address(self.run, self.connect, Access(self.keys, self.member, self.insecure), roles)
        with RunClient(where, meet_agents=meet_agents) as client:
            client.find_plant(self.wait)
            yield client


def of_live_run(command: Callable[..., None]) -> Callable[..., None]:
    """Have typer read the fields of a command's parameter `live`, a dataclass, as its last options."""
    own = dict(inspect.signature(command, eval_str=True).parameters)
    options: Any = own.pop("live").annotation
    fields = inspect.signature(options, eval_str=True).parameters

    @wraps(command)
    def called(**words: Any) -> None:
        command(live=options(**{field: words.pop(field) for field in fields}), **words)

    parameters = own | dict(fields)
    called.__signature__ = inspect.Signature(list(parameters.values()))  # type: ignore[attr-defined]
    called.__annotations__ = {one.name: one.annotation for one in parameters.values()}
    return called


def address(run: str, connect: list[str] | None, access: Access, roles: tuple[Role, ...], name: str = "") -> RunAddress:
    """Return the address of a run, with the credentials for it; raise UsageError or KeysError if they do not fit."""
    where = address_of(run, connect)
    endpoints = tuple(with_protocol(text, keys=access.keys is not None, default=ENDPOINT) for text in where.connect)
    for text in endpoints:
        check_open("--connect", text, access)
    return replace(where, connect=endpoints, credentials=opened(access, roles, name), access=access)


def check_open(option: str, endpoint: str, access: Access) -> None:
    """Raise UsageError if an endpoint cannot be used with or without certificates."""
    if wrong := objection(option, endpoint, keys=access.keys is not None, insecure=access.insecure):
        raise UsageError(wrong)


def opened(access: Access, roles: tuple[Role, ...], name: str = "") -> Credentials | None:
    """Return the credentials of a command; say so if the certificate ends soon."""
    if access.keys is None:
        if access.name:
            raise UsageError("--as: needs --keys DIR, the folder of the certificates")
        return None
    credentials, note = open_credentials(access.keys, roles, name or access.name)
    if note:
        typer.echo(f"NOTE  {note}", err=True)
    return credentials


def finish(outcome: ProcessOutcome, *, law_failed: bool = False) -> None:
    """End with the exit code of a live run; `law_failed` gives that of a failed law, however the run itself ended."""
    if outcome.interrupted:
        code = TERMINATED if outcome.interrupted == "SIGTERM" else INTERRUPTED
        fail(f"{outcome.interrupted}: everything that was started here has ended", code=code)
    if outcome.broke:
        fail(outcome.broke, code=CLAIM_FAILED if law_failed else BROKEN)
    if law_failed:
        raise typer.Exit(CLAIM_FAILED)
