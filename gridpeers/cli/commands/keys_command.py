"""The commands `gridpeers keys ...`: a site's certificates."""

from __future__ import annotations

from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from gridpeers.cli.usage import Commands, argument, flag, option, require
from gridpeers.wire.keys import Role
from gridpeers.wire.trust import site_authority
from gridpeers.wire.trust.credentials import DATE_AND_TIME
from gridpeers.wire.trust.key_folder import CA_KEY, LIST, KeysError, read_list

app = typer.Typer(
    cls=Commands,
    no_args_is_help=True,
    rich_markup_mode=None,
    help="Make, issue and revoke the certificates of a site.\n\n"
    "Links are then encrypted. Every process proves its identity, and can send only its own messages "
    "(docs/how-to/several-hosts.md).\n\n"
    "Example:  gridpeers keys init lab",
)

_Keys = Annotated[Path, option("DIR", "Folder of the site; the current one if left out.")]
_Days = Annotated[float, option("N", "Life of the certificates (days).", min=0.01, max=3650.0)]
_require_cryptography = partial(require, {"cryptography": "certificates"}, "keys")


@app.command()
def init(
    site: Annotated[Path, argument("SITE", "New folder for the certificates; the site takes its name.")],
    days: _Days = 365.0,
) -> None:
    """Make a site: an authority, and certificates of a plant, an operator and a viewer.

    Example:  gridpeers keys init lab
    """
    _require_cryptography()
    known = site_authority.make_site(site, days=days)
    names = ", ".join(f"{member.name} ({member.role})" for member in known.members)
    typer.echo(f"{site}: the site {known.site}, with certificates of {names}, until {known.members[0].expires}")
    typer.echo(
        f"Keep {site}/ca.key here: it signs certificates of any name. Next: gridpeers keys issue inv1 --keys {site}"
    )


@app.command()
def issue(
    names: Annotated[list[str], argument("NAME...", "Names of the members; an agent has the name of its inverter.")],
    role: Annotated[
        Role | None, flag("Role of a new name, agent if left out; a known name keeps its role.", "--role")
    ] = None,
    keys: _Keys = Path(),
    days: _Days = 365.0,
) -> None:
    """Issue certificates, or renew them. An agent may join a run that has already started.

    Example:  gridpeers keys issue inv1 inv2 --keys lab
    """
    _require_cryptography()
    names = list(dict.fromkeys(names))
    known = read_list(keys)
    if problems := [why for name in names if (why := site_authority.objection(known, name, role))]:
        raise KeysError("\n".join(problems))  # all of them, before any certificate is issued
    for name in names:
        member = site_authority.issue(keys, name, role, days=days)
        typer.echo(f"{keys / name}.pem: certificate of {name}, role {member.role}, until {member.expires}")


@app.command()
def revoke(
    name: Annotated[str, argument("NAME", "Name of the member; an agent has the name of its inverter, e.g. inv4.")],
    keys: _Keys = Path(),
) -> None:
    """Revoke a certificate.

    Copy members.json to every host, and restart the processes: until then they accept the certificate.

    Example:  gridpeers keys revoke inv4 --keys lab
    """
    _require_cryptography()
    site_authority.revoke(keys, name)
    typer.echo(
        f"{name}: revoked. Copy {keys / 'members.json'} to every host, and restart all processes: those that run "
        "still accept it"
    )


@app.command()
def show(keys: _Keys = Path()) -> None:
    """Show the members of a site.

    Each line has the role, the name, the end of the certificate, and "key here" if this folder has the key.

    Example:  gridpeers keys show --keys lab
    """
    _require_cryptography()
    known, now = read_list(keys), f"{datetime.now(UTC):{DATE_AND_TIME}}"  # noqa: TID251  # ends of certificates are dates
    authority = f"; {CA_KEY} is here: certificates are issued in this folder" if (keys / CA_KEY).is_file() else ""
    typer.echo(f"site {known.site}, {LIST} is version {known.version}{authority}")
    width = max(len(member.name) for member in known.members)
    for member in sorted(known.members, key=lambda member: (member.role, member.name)):
        state, here = "revoked", ""
        if not member.revoked:
            state = f"{'expired ' if member.expires < now else 'valid    until'} {member.expires}"
            here = ", key here" if (keys / f"{member.name}.key").is_file() else ""
        typer.echo(f"{member.role:9} {member.name:{width}}  {state}{here}")
