"""Files of certificates and private keys: read them, and check that they are valid, belong together and are private.

The package cryptography is imported where it is used: a run without certificates does without.
"""

from __future__ import annotations

import stat
from collections.abc import Sequence
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from gridpeers.wire.trust.credentials import DATE_AND_TIME, Member
from gridpeers.wire.wording import printable

if TYPE_CHECKING:
    from cryptography import x509

CA, CA_KEY = "ca.pem", "ca.key"
"""Names of the files of a site's authority."""


class KeysError(ValueError):
    """Certificates or keys cannot be used; the message says which, why, and what to do."""


def own_certificate(folder: Path, member: Member) -> x509.Certificate | None:
    """Return the certificate of a member if it is in the folder; None if it is not, or is of an earlier generation."""
    path = folder / f"{member.name}.pem"
    if not path.exists():
        return None
    certificate = read_certificate(path)
    return certificate if _common_name(certificate) == member.common_name else None


def require_private(path: Path) -> None:
    """Raise KeysError if anybody but its owner may read or write a file."""
    mode = stat.S_IMODE(path.stat().st_mode)
    if mode & 0o077:
        raise KeysError(f"{path}: others may read or change it (mode {mode:04o}); chmod 600 {path}")


def exposed_keys(folder: Path) -> list[str]:
    """Return a sentence for each private key in a folder that others than its owner may read or change."""
    sentences = []
    for path in sorted(folder.glob("*.key")):
        try:
            require_private(path)
        except KeysError as error:
            sentences.append(str(error))
        except OSError as error:
            sentences.append(f"{path}: cannot be read: {error.strerror}")
    return sentences


def mistaken_keys(folder: Path, members: Sequence[Member]) -> dict[str, str]:
    """Return a sentence for each private key in a folder that is not that of the certificate beside it, by its file.

    The authority's key is looked at in any case.
    """
    sentences = {}
    pairs: list[tuple[str, x509.Certificate | None]] = [(CA_KEY, read_certificate(folder / CA))]
    for member in members:
        with suppress(KeysError):  # of a damaged certificate, which says so itself
            pairs.append((f"{member.name}.key", own_certificate(folder, member)))
    for file, certificate in pairs:
        if certificate is None or not (folder / file).is_file():
            continue
        try:
            _require_match(folder / file, read_file(folder / file), certificate)
        except KeysError as error:
            sentences[file] = str(error)
    return sentences


def check_certificate(
    own: x509.Certificate, ca: x509.Certificate, path: Path, folder: Path, member: Member, now: datetime
) -> datetime:
    """Raise KeysError unless a certificate is valid and names the member; return its end."""
    from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm

    try:
        own.verify_directly_issued_by(ca)
    except (InvalidSignature, UnsupportedAlgorithm, ValueError, TypeError):
        raise KeysError(
            f"{path}: is not signed by {folder / CA}: it is of another site; copy both from the same one"
        ) from None
    common_name = _common_name(own)
    if common_name != member.common_name:
        raise KeysError(
            f'{path}: is the certificate of "{printable(common_name)}", not of "{member.common_name}"; copy that of '
            f"{member.name}, or issue it anew"
        )
    for certificate, what in ((own, path), (ca, folder / CA)):
        begins, ends = certificate.not_valid_before_utc, certificate.not_valid_after_utc
        if now > ends:
            renewal = f"gridpeers keys issue {member.name}" if certificate is own else "gridpeers keys init"
            raise KeysError(f"{what}: expired on {ends:{DATE_AND_TIME}}; {renewal} makes a new one")
        if now < begins:
            raise KeysError(
                f"{what}: is valid from {begins:{DATE_AND_TIME}}, and the clock of this host shows "
                f"{now:%Y-%m-%d %H:%M}; set the clock"
            )
    first_end: datetime = min(own.not_valid_after_utc, ca.not_valid_after_utc)
    return first_end


def check_key(path: Path, certificate: x509.Certificate) -> None:
    """Raise KeysError unless a private key is that of a certificate, and private."""
    data = read_file(path)
    require_private(path)
    _require_match(path, data, certificate)


def _require_match(path: Path, data: bytes, certificate: x509.Certificate) -> None:
    """Raise KeysError unless the private key in a file is that of a certificate."""
    from cryptography.exceptions import UnsupportedAlgorithm
    from cryptography.hazmat.primitives.serialization import load_pem_private_key

    try:
        key = load_pem_private_key(data, None)
    except (ValueError, TypeError, UnsupportedAlgorithm) as error:
        raise KeysError(f"{path}: is no private key: {printable(str(error), 80)}; copy it anew from the site") from None
    if key.public_key() != certificate.public_key():
        raise KeysError(f"{path}: is not the key of {path.with_suffix('.pem').name}; copy both from the same site")


def read_certificate(path: Path) -> x509.Certificate:
    """Return the certificate of a file."""
    from cryptography import x509
    from cryptography.exceptions import UnsupportedAlgorithm

    data = read_file(path)
    try:
        certificate = x509.load_pem_x509_certificate(data)
        certificate.public_key(), certificate.subject, certificate.not_valid_after_utc  # read when they are asked for
        return certificate
    except (ValueError, UnsupportedAlgorithm):
        raise KeysError(f"{path}: is no certificate in PEM; copy it anew from the site") from None


def read_file(path: Path) -> bytes:
    """Return what a file of a site has."""
    try:
        if not path.is_dir() and path.exists() and not path.is_file():  # to read a pipe would take for ever
            raise KeysError(f"{path}: is no file; copy it anew from the site")
        return path.read_bytes()
    except FileNotFoundError:
        raise KeysError(f"{path}: is missing; copy it from the folder where the site issues certificates") from None
    except OSError as error:
        raise KeysError(f"{path}: cannot be read: {error.strerror}") from None


def _common_name(certificate: x509.Certificate) -> str:
    """Return the common name of a certificate; empty if it has none."""
    from cryptography.x509.oid import NameOID

    named = certificate.subject.get_attributes_for_oid(NameOID.COMMON_NAME)
    return str(named[0].value) if named else ""


def validity(folder: Path, member: Member, now: datetime) -> str:
    """Return the state of a member's certificate, with the times (UTC) at which it begins and ends.

    They are those of the certificate in the folder, as that is the one which a process here shows. Where it is not
    there, the end is that of the list of members, and its begin is not known.

    Returns
    -------
    str
        "valid", "not yet", "expired" with times, "revoked", or "damaged" and what is wrong with its file.
    """
    if member.revoked:
        return "revoked"
    try:
        own = own_certificate(folder, member)
    except KeysError as error:
        return f"damaged  {error}"
    if own is None:
        gone = member.expires < f"{now:{DATE_AND_TIME}}"[: len(member.expires)]
        return f"expired  {member.expires}" if gone else f"valid    until {member.expires}"
    begins, ends = own.not_valid_before_utc, own.not_valid_after_utc
    state = "expired" if ends < now else "not yet" if now < begins else "valid"
    return f"{state:8} {begins:%Y-%m-%d %H:%M} to {ends:{DATE_AND_TIME}}"
