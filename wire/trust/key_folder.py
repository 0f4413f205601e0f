"""The folder with a site's certificates and keys: which member's a process takes, and whether it may use them.

``ca.pem`` is the certificate of the site's authority and ``ca.key`` its private key, which stays where certificates are
issued. ``NAME.pem`` and ``NAME.key`` are those of a member. ``members.json`` lists all members, signed by the
authority. A host needs all but ``ca.key`` and the files of other hosts' members.

The package cryptography is imported where it is used: a run without certificates does without.
"""

from __future__ import annotations

import base64
import os
import socket
import ssl
import stat
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from gridpeers.wire.codec import decode_foreign
from gridpeers.wire.keys import Role
from gridpeers.wire.messages import is_name
from gridpeers.wire.trust.credentials import DATE_AND_TIME, Credentials, SiteMember
from gridpeers.wire.wording import InputError, printable

if TYPE_CHECKING:
    from cryptography import x509

CA, CA_KEY, LIST = "ca.pem", "ca.key", "members.json"  # Names of the site's own files

COMMANDING: tuple[Role, ...] = ("operator",)  # Roles that may command a run
SOON = timedelta(days=30)  # A certificate ends soon if it ends within this time


class KeysError(InputError):
    """Certificates or keys cannot be used; the message says which and why, and the next step."""


class MemberList(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """All members of a site, revoked ones included."""

    site: str
    version: int
    """Number of changes so far; of two lists the greater is the later."""
    members: tuple[SiteMember, ...] = ()

    def of(self, name: str) -> SiteMember | None:
        return next((member for member in self.members if member.name == name), None)


class SignedList(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    list: MemberList
    signature: str
    """Signature of the authority over the list as JSON (ECDSA with SHA-256, base64)."""


def read_list(folder: Path) -> MemberList:
    """Return the members of a site, if the list is whole and signed by the folder's authority."""
    from cryptography.exceptions import InvalidSignature
    from cryptography.hazmat.primitives import hashes
    from cryptography.hazmat.primitives.asymmetric import ec

    # Path.is_dir may raise an error where the folder above may not be entered
    if not os.path.isdir(folder):  # noqa: PTH112
        raise KeysError(f"{folder}: does not exist; gridpeers keys init {folder} makes a folder of keys")
    public = read_certificate(folder / CA).public_key()
    try:
        signed = decode_foreign(msgspec.json.Decoder(SignedList).decode, _read(folder / LIST))
        signature = base64.b64decode(signed.signature, validate=True)
        if not all(is_name(member.name) for member in signed.list.members):
            raise ValueError("it has an invalid name")
    except KeysError:
        raise
    except ValueError as error:
        raise KeysError(f"{folder / LIST}: cannot be read: {error}; copy it from the site again") from None
    try:
        if not isinstance(public, ec.EllipticCurvePublicKey):  # no authority that gridpeers has made
            raise InvalidSignature
        public.verify(signature, msgspec.json.encode(signed.list), ec.ECDSA(hashes.SHA256()))
    except InvalidSignature:
        raise KeysError(
            f"{folder / LIST}: is not signed by {CA} beside it; copy both from the same site, unchanged"
        ) from None
    return signed.list


def open_credentials(
    folder: Path, roles: Sequence[Role], name: str = "", *, now: datetime | None = None
) -> tuple[Credentials, str]:
    """Check a member's files and return its credentials, and a sentence if its certificate ends soon.

    Without a name the member is the first of these roles, the preferred one first, whose key is there. Raise KeysError
    if anything about the files is wrong.
    """
    now = now or datetime.now(UTC)  # noqa: TID251  # ends of certificates are dates
    known, either = read_list(folder), " or ".join(roles)
    there = [member for member in known.members if not member.revoked and (folder / f"{member.name}.key").is_file()]
    preferred = next((each for role in roles for each in there if each.role == role), None)
    member = known.of(name) if name else preferred
    if name and member is None:
        have = ", ".join(each.name for each in known.members if each.role in roles) or "none"
        raise KeysError(
            f'{folder}: no certificate was issued to "{printable(name)}"; those of role {either}: {have}; '
            f"gridpeers keys issue {printable(name)} --role {roles[0]} --keys {folder} issues one"
        )
    if member is None or member.role not in roles:
        other = member or next((each for each in there if each.role == "viewer"), None)
        if other and other.role == "viewer" and tuple(roles) == COMMANDING:
            look = "which may look at a run (status, watch, view), but not command it"
            what = f"{other.name} has the role viewer, {look}; an {either} may"
        elif member:
            what = f"{member.name} has the role {member.role}; this needs the role {either}"
        else:
            what = f"has no key of a member with the role {either}"
        have = " or ".join(each.name for each in known.members if each.role in roles and not each.revoked)
        way = f"--as {have} takes the certificate of one" if have else f"gridpeers keys issue NAME --role {roles[0]}"
        raise KeysError(f"{folder}: {what}: {way}")
    if member.revoked:
        raise KeysError(
            f"{folder}/{member.name}.pem: was revoked; gridpeers keys issue {member.name} gives {member.name} a new one"
        )
    certificate, key = folder / f"{member.name}.pem", folder / f"{member.name}.key"
    ends = _end_of(read_certificate(certificate), certificate, folder, member, now)
    load_pair(key)
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


def _end_of(own: x509.Certificate, path: Path, folder: Path, member: SiteMember, now: datetime) -> datetime:
    """Return the end of a member's certificate, or of the authority's if that is earlier, if both are valid."""
    from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
    from cryptography.x509.oid import NameOID

    ca = read_certificate(folder / CA)
    try:
        own.verify_directly_issued_by(ca)
    except (InvalidSignature, UnsupportedAlgorithm, ValueError, TypeError):
        raise KeysError(
            f"{path}: is not signed by {folder / CA}: it is of another site; copy both from the same one"
        ) from None
    common_name = "".join(str(it.value) for it in own.subject.get_attributes_for_oid(NameOID.COMMON_NAME))
    if common_name != member.common_name:
        raise KeysError(
            f'{path}: is the certificate of "{printable(common_name)}", not of "{member.common_name}"; copy that of '
            f"{member.name}, or issue a new one"
        )
    for certificate, what, renewal in ((own, path, f"issue {member.name}"), (ca, folder / CA, "init")):
        begins, ends = certificate.not_valid_before_utc, certificate.not_valid_after_utc
        if now > ends:
            raise KeysError(f"{what}: expired on {ends:{DATE_AND_TIME}}; gridpeers keys {renewal} makes a new one")
        if now < begins:
            raise KeysError(
                f"{what}: is valid from {begins:{DATE_AND_TIME}}, and the clock of this host shows "
                f"{now:%Y-%m-%d %H:%M}; set the clock"
            )
    return min(own.not_valid_after_utc, ca.not_valid_after_utc)


def read_certificate(path: Path) -> x509.Certificate:
    from cryptography import x509
    from cryptography.exceptions import UnsupportedAlgorithm

    data = _read(path)
    try:
        certificate = x509.load_pem_x509_certificate(data)
        certificate.public_key(), certificate.subject, certificate.not_valid_after_utc  # read when they are asked for
        return certificate
    except (ValueError, UnsupportedAlgorithm):
        raise KeysError(f"{path}: is not a certificate in PEM; copy it from the site again") from None


def load_pair(path: Path) -> tuple[x509.Certificate, Any]:
    """Return the certificate beside a private key, and the key: they belong together, and the key is its owner's."""
    from cryptography.exceptions import UnsupportedAlgorithm
    from cryptography.hazmat.primitives.serialization import load_pem_private_key

    data, beside = _read(path), path.with_suffix(".pem")
    mode = stat.S_IMODE(path.stat().st_mode)
    if mode & 0o077:
        raise KeysError(f"{path}: others may read or change it (mode {mode:04o}); chmod 600 {path}")
    try:
        key: Any = load_pem_private_key(data, None)
    except (ValueError, TypeError, UnsupportedAlgorithm) as error:
        raise KeysError(
            f"{path}: is no private key: {printable(str(error), 80)}; copy it from the site again"
        ) from None
    certificate = read_certificate(beside)
    if key.public_key() != certificate.public_key():
        raise KeysError(f"{path}: is not the key of {beside.name}; copy both from the same site")
    return certificate, key


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise KeysError(
            f"{path}: is missing; copy it from the folder where the site issues certificates, or give another "
            "folder by --keys"
        ) from None
    except OSError as error:
        raise KeysError(f"{path}: cannot be read: {error.strerror}") from None


def tls_refusal(host: str, port: int, credentials: Credentials | None, timeout: float) -> str:
    """Return why the other end and this one do not agree on a link; empty if they do, or if it is not known.

    Zenoh tries again and again and says nothing, so the handshake is done once here; each of its steps may take as long
    as `timeout` (s). In TLS 1.3 the other end's alert comes with the first bytes that this one reads.
    """
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE  # a member is known by its name alone
    try:
        if credentials is not None:
            context.load_cert_chain(credentials.certificate, credentials.key)
            context.load_verify_locations(credentials.ca)
            context.verify_mode = ssl.CERT_REQUIRED
        with socket.create_connection((host, port), timeout) as raw, context.wrap_socket(raw) as secured:
            secured.recv(1)
    except ssl.SSLCertVerificationError as error:
        ca = "" if credentials is None else credentials.ca
        return f"shows a certificate that {ca} does not accept ({error.verify_message})"
    except ssl.SSLError as error:
        _, alert, name = (error.reason or "").partition("ALERT_")
        if alert and credentials is None:
            return "asks for a certificate"
        if alert and credentials is not None:
            why = "expired by the clock of that host" if name == "CERTIFICATE_EXPIRED" else f"{name}, of another site"
            return f"does not accept the certificate of {credentials.own.name} ({why})"
    except OSError:  # nobody is there, or files of ours have gone
        pass
    return ""
