"""The folder with a site's certificates and keys: which member's a process takes, and whether it may use them.

``ca.pem`` is the certificate of the site's authority and ``ca.key`` its private key, which stays where certificates are
issued. ``NAME.pem`` and ``NAME.key`` are those of a member. ``members.json`` lists all members, signed by the
authority. A host needs ``ca.pem``, ``members.json`` and the two files of its own members, and no more.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path

from gridpeers.wire.printable import printable
from gridpeers.wire.trust.certificate_files import CA, KeysError, check_certificate, check_key, read_certificate
from gridpeers.wire.trust.credentials import Credentials
from gridpeers.wire.trust.member import DATE_AND_TIME, Member, Role
from gridpeers.wire.trust.member_list import MemberList, read_list

COMMANDING: tuple[Role, ...] = ("operator",)
"""Roles that may command a run."""

SOON = timedelta(days=30)
"""Time before its end at which a certificate is said to end soon."""


def open_credentials(
    folder: Path, roles: Sequence[Role], name: str = "", *, now: datetime | None = None
) -> tuple[Credentials, str]:
    """Check a member's files and return its credentials, and a sentence if its certificate ends soon.

    Parameters
    ----------
    folder : Path
        Folder of the site, or what was copied of it.
    roles : Sequence[Role]
        Roles that will do, the preferred first.
    name : str, optional
        Name of the member; without one, the first of these roles whose key is there.
    now : datetime, optional
        Present time.

    Raises
    ------
    KeysError
        If anything about the files is wrong.
    """
    now = now or datetime.now(UTC)
    known = read_list(folder)
    member = known.of(name) if name else _present(folder, known, roles)
    if member is None:
        if name:
            have = ", ".join(each.name for each in known.members if each.role in roles) or "none"
            raise KeysError(
                f'{folder}: no certificate was issued to "{printable(name)}"; those of role {_or(roles)}: {have}; '
                f"gridpeers keys issue {printable(name)} --role {roles[0]} --keys {folder} issues one"
            )
        if tuple(roles) == COMMANDING and (viewer := _present(folder, known, ("viewer",))) is not None:
            raise KeysError(_viewer_refusal(folder, known, viewer))
        raise KeysError(
            f"{folder}: has no key of a member with role {_or(roles)}; copy NAME.pem and NAME.key of one, or issue one "
            "with gridpeers keys issue"
        )
    if member.role == "viewer" and tuple(roles) == COMMANDING:
        raise KeysError(_viewer_refusal(folder, known, member))
    if member.role not in roles:
        raise KeysError(f"{folder}: {member.name} has the role {member.role}; this needs one with role {_or(roles)}")
    if member.revoked:
        raise KeysError(
            f"{folder}/{member.name}.pem: was revoked; gridpeers keys issue {member.name} gives {member.name} a new one"
        )
    certificate, key = folder / f"{member.name}.pem", folder / f"{member.name}.key"
    ca, own = read_certificate(folder / CA), read_certificate(certificate)
    ends = check_certificate(own, ca, certificate, folder, member, now)
    check_key(key, own)
    soon = (
        f"the certificate of {member.name} ends on {ends:{DATE_AND_TIME}}; gridpeers keys issue {member.name} renews it"
    )
    return Credentials(
        own=member,
        ca=str((folder / CA).absolute()),
        certificate=str(certificate.absolute()),
        key=str(key.absolute()),
        members=known.members,
    ), soon if ends - now < SOON else ""


def _present(folder: Path, known: MemberList, roles: Sequence[Role]) -> Member | None:
    """Return the first member of these roles whose key is in the folder."""
    there = [member for member in known.members if not member.revoked and (folder / f"{member.name}.key").is_file()]
    return next((member for role in roles for member in there if member.role == role), None)


def _viewer_refusal(folder: Path, known: MemberList, viewer: Member) -> str:
    """Return why a viewer cannot give a command, and who can."""
    who = [each for each in known.members if each.role in COMMANDING and not each.revoked]
    here = next((each.name for each in who if (folder / f"{each.name}.key").is_file()), "")
    if here:
        way = f"--as {here} takes the certificate of one"
    elif who:
        way = (
            f"give the command where the certificate of {' or '.join(each.name for each in who)} is, or copy its files "
            f"to {folder}"
        )
    else:
        way = f"gridpeers keys issue NAME --role {COMMANDING[0]} makes one, where the site was made"
    return (
        f"{folder}: {viewer.name} has the role viewer, which may look at a run (status, watch, view) and not command "
        f"it; an {COMMANDING[0]} may: {way}"
    )


def _or(roles: Sequence[Role]) -> str:
    return " or ".join(roles)
