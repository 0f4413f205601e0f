"""The folder with a site's certificates and keys: which member's a process takes, and whether it may use them.

``ca.pem`` is the certificate of the site's authority and ``ca.key`` its private key, which stays where certificates are
issued. ``NAME.pem`` and ``NAME.key`` are those of a member. ``members.json`` lists all members, signed by the
authority. A host needs ``ca.pem``, ``members.json`` and the two files of its own members, and no more.
"""

from __future__ import annotations

import base64
import stat
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path

import msgspec

from gridpeers.wire.bounds import is_name
from gridpeers.wire.codec import decode_foreign
from gridpeers.wire.keys import Role
from gridpeers.wire.trust.certificate_files import (
    CA,
    KeysError,
    check_certificate,
    check_key,
    read_certificate,
    read_file,
)
from gridpeers.wire.trust.credentials import DATE_AND_TIME, Credentials, Member
from gridpeers.wire.wording import printable

LIST = "members.json"
"""Name of its file."""


class MemberList(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """All members of a site, revoked ones included."""

    site: str
    """Name of the site."""
    version: int
    """Number of changes so far; of two lists the greater is the later."""
    members: tuple[Member, ...] = ()

    def of(self, name: str) -> Member | None:
        """Return the member of a name; None if there is none."""
        return next((member for member in self.members if member.name == name), None)


class SignedList(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The content of ``members.json``."""

    list: MemberList
    signature: str
    """Signature of the authority over the list as JSON (ECDSA with SHA-256, base64)."""


def read_list(folder: Path) -> MemberList:
    """Return the members of a site, if the list is whole and signed by the folder's authority."""
    from cryptography.exceptions import InvalidSignature
    from cryptography.hazmat.primitives import hashes
    from cryptography.hazmat.primitives.asymmetric import ec

    _require_folder(folder)
    if not (folder / CA).exists() and not (folder / LIST).exists():
        here = "the present folder" if folder == Path() else str(folder)
        raise KeysError(
            f"{here} has no certificates: neither {CA} nor {LIST} is there; name by --keys DIR the folder that "
            "gridpeers keys init has made"
        )
    public = read_certificate(folder / CA).public_key()
    data = read_file(folder / LIST)
    try:
        signed = decode_foreign(msgspec.json.Decoder(SignedList).decode, data)
        signature = base64.b64decode(signed.signature, validate=True)
    except ValueError as error:
        raise KeysError(f"{folder / LIST}: cannot be read: {error}; copy it anew from the site") from None
    try:
        if not isinstance(public, ec.EllipticCurvePublicKey):  # no authority that gridpeers has made
            raise InvalidSignature
        public.verify(signature, msgspec.json.encode(signed.list), ec.ECDSA(hashes.SHA256()))
    except InvalidSignature:
        raise KeysError(
            f"{folder / LIST}: is not signed by {CA} beside it; copy both from the same site, unchanged"
        ) from None
    if not all(is_name(member.name) for member in signed.list.members):
        raise KeysError(f"{folder / LIST}: has a name that is none; copy it anew from the site")
    return signed.list


def _require_folder(folder: Path) -> None:
    try:
        there = stat.S_ISDIR(folder.stat().st_mode)
    except FileNotFoundError:
        raise KeysError(f"{folder}: there is no such folder of keys; gridpeers keys init {folder} makes one") from None
    except OSError as error:
        raise KeysError(f"{folder}: cannot be read: {error.strerror}") from None
    if not there:
        raise KeysError(f"{folder}: is no folder; say the folder that gridpeers keys init has made")


COMMANDING: tuple[Role, ...] = ("operator",)
"""Roles that may command a run."""

SOON = timedelta(days=30)
"""Time before its end at which a certificate is said to end soon."""


def open_credentials(
    folder: Path, roles: Sequence[Role], name: str = "", *, now: datetime | None = None
) -> tuple[Credentials, str]:
    """Check a member's files and return its credentials, and a sentence if its certificate ends soon.

    Without a name the member is the first of these roles, the preferred one first, whose key is there.

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
