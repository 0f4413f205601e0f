"""The list of a site's members, signed by its authority: ``members.json``."""

from __future__ import annotations

import base64
import stat
from pathlib import Path

import msgspec

from gridpeers.wire.bounds import is_name
from gridpeers.wire.foreign_bytes import decode_foreign
from gridpeers.wire.trust.certificate_files import CA, KeysError, read_certificate, read_file
from gridpeers.wire.trust.member import Member

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
