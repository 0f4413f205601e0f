"""The authority of a site: make it, issue certificates, revoke them. Its private key stays in its folder."""

from __future__ import annotations

import base64
import os
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from gridpeers.wire.keys import Role
from gridpeers.wire.messages import is_name
from gridpeers.wire.trust.credentials import DATE_AND_TIME, LONGEST_COMMON_NAME, SiteMember
from gridpeers.wire.trust.key_folder import CA, CA_KEY, LIST, KeysError, MemberList, SignedList, load_pair, read_list
from gridpeers.wire.wording import printable

if TYPE_CHECKING:
    from cryptography import x509
    from cryptography.hazmat.primitives.asymmetric.ec import EllipticCurvePrivateKey

LIFE_OF_CA = timedelta(days=3650)  # Life of an authority: ten years, as no process can renew it
LIFE_DAYS = 365  # Life (days) of a member's certificate
SKEW = timedelta(minutes=5)  # Time by which a certificate is valid before its issue, because clocks of hosts differ

RESERVED = {text for file in (CA, CA_KEY, LIST) for text in (file, Path(file).stem)}
"""Names that no member may have, because files of the site have them."""

FIRST: tuple[tuple[str, Role], ...] = (("plant", "plant"), ("operator", "operator"), ("viewer", "viewer"))
"""Members of every new site."""


def make_site(folder: Path, *, days: float = LIFE_DAYS, now: datetime | None = None) -> MemberList:
    """Make a site's authority and its first certificates in a new folder."""
    from cryptography.hazmat.primitives.asymmetric import ec

    now = now or datetime.now(UTC)  # noqa: TID251  # ends of certificates are dates
    site = folder.absolute().name
    if not is_name(site):
        raise KeysError(f'{folder}: "{printable(site)}" cannot name a site; use letters, digits, "_", "-", "."')
    try:
        if folder.exists() or folder.is_symlink():
            raise KeysError(f"{folder}: already exists; gridpeers keys show --keys {folder} shows it")
        folder.mkdir(0o700, parents=True)
        key = ec.generate_private_key(ec.SECP256R1())
        _write_key(folder / CA_KEY, key)
        _write_pem(folder / CA, _certificate(f"gridpeers site {site}", key, key, None, now, LIFE_OF_CA))
        (folder / ".gitignore").write_text("*\n", encoding="utf-8")  # no key gets into a repository by `git add`
        _write_list(folder, MemberList(site=site, version=0), key)
        for name, role in FIRST:
            issue(folder, name, role, days=days, now=now)
    except OSError as error:
        raise KeysError(f"{folder}: cannot be made: {error.strerror}; remove its incomplete files") from None
    return read_list(folder)


def issue(
    folder: Path, name: str, role: Role | None = None, *, days: float = LIFE_DAYS, now: datetime | None = None
) -> SiteMember:
    """Issue a certificate to a name, or renew it; return the member.

    An agent's name is that of its inverter. Without a role a name keeps the one it has, and any other is an agent.
    """
    from cryptography.hazmat.primitives.asymmetric import ec

    now = now or datetime.now(UTC)  # noqa: TID251  # ends of certificates are dates
    known, ca, ca_key = _authority(folder)
    before = known.of(name)
    role = role or ("agent" if before is None else before.role)
    if problem := objection(known, name, role):
        raise KeysError(problem)
    if now >= ca.not_valid_after_utc:
        raise KeysError(
            f"{folder / CA}: expired on {ca.not_valid_after_utc:{DATE_AND_TIME}}; gridpeers keys init makes a new site"
        )
    generation = 1 if before is None else before.generation + before.revoked
    ends = min(now + timedelta(days=days), ca.not_valid_after_utc)
    member = SiteMember(name=name, role=role, generation=generation, expires=f"{ends:{DATE_AND_TIME}}")
    key = ec.generate_private_key(ec.SECP256R1())
    certificate = _certificate(member.common_name, key, ca_key, ca, now, ends - now)
    _write_key(folder / f"{name}.key", key)
    _write_pem(folder / f"{name}.pem", certificate)
    _write_list(folder, _with(known, member), ca_key)
    return member


def objection(known: MemberList, name: str, role: Role | None) -> str:
    """Return why no certificate of a role can be issued to a name; empty if one can; see `issue`."""
    if not is_name(name) or name[0] in ".-":  # which would hide its files, or be an option of a command
        return (
            f'"{printable(name)}" cannot be a name; use 1 to 64 letters, digits, "_", "-", ".", the first of them '
            "neither a dot nor a dash"
        )
    if name.casefold() in RESERVED:
        return f'"{name}" cannot be a name: a file of the site has it; give the {role or "agent"} another name'
    before = known.of(name)
    role = role or ("agent" if before is None else before.role)
    if before is not None and before.role != role:
        return f"{name}: already has the role {before.role}; give the {role} another name"
    if len(f"{role}:{name}") > LONGEST_COMMON_NAME - 4:  # room for later generations
        return f"{name}: is too long for a certificate; {role}:NAME has at most {LONGEST_COMMON_NAME - 4} letters"
    return ""


def revoke(folder: Path, name: str) -> SiteMember:
    """Revoke the certificate of a name, and delete its key here; return the member."""
    known, _, ca_key = _authority(folder)
    member = known.of(name)
    if member is None:
        have = ", ".join(each.name for each in known.members)
        raise KeysError(f'{folder}: no certificate was issued to "{printable(name)}"; certificates exist of {have}')
    if member.revoked:
        raise KeysError(f"{name}: its certificate is already revoked")
    revoked = msgspec.structs.replace(member, revoked=True)
    _write_list(folder, _with(known, revoked), ca_key)
    try:
        (folder / f"{name}.key").unlink(missing_ok=True)
    except OSError as error:
        raise KeysError(f"{name}: is revoked; remove its key from {folder}: {error.strerror}") from None
    return revoked


def _with(known: MemberList, member: SiteMember) -> MemberList:
    others = [each for each in known.members if each.name != member.name]
    return msgspec.structs.replace(known, version=known.version + 1, members=(*others, member))


def _authority(folder: Path) -> tuple[MemberList, x509.Certificate, EllipticCurvePrivateKey]:
    known, path = read_list(folder), folder / CA_KEY
    if not path.is_file():
        raise KeysError(f"{path}: is missing; certificates are issued and revoked where the site was made")
    return known, *load_pair(path)


def _certificate(
    common_name: str,
    key: EllipticCurvePrivateKey,
    ca_key: EllipticCurvePrivateKey,
    ca: x509.Certificate | None,
    now: datetime,
    life: timedelta,
) -> x509.Certificate:
    """Return a certificate signed by an authority, or the authority's own if there is none yet."""
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes
    from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

    subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, common_name)])
    authority = ca is None
    uses = dict.fromkeys(("content_commitment", "key_encipherment", "data_encipherment", "key_agreement"), False)
    uses |= {"digital_signature": not authority, "key_cert_sign": authority, "crl_sign": authority}
    builder = (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(subject if ca is None else ca.subject)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(min(now - SKEW, now + life))
        .not_valid_after(now + life)
        .add_extension(x509.BasicConstraints(ca=authority, path_length=0 if authority else None), critical=True)
        .add_extension(x509.KeyUsage(**uses, encipher_only=False, decipher_only=False), critical=True)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
        .add_extension(x509.AuthorityKeyIdentifier.from_issuer_public_key(ca_key.public_key()), critical=False)
    )
    if not authority:
        both = [ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH]  # each end of a link may be either
        builder = builder.add_extension(x509.ExtendedKeyUsage(both), critical=False)
    return builder.sign(ca_key, hashes.SHA256())


def _write_list(folder: Path, known: MemberList, ca_key: EllipticCurvePrivateKey) -> None:
    from cryptography.hazmat.primitives import hashes
    from cryptography.hazmat.primitives.asymmetric import ec

    signature = ca_key.sign(msgspec.json.encode(known), ec.ECDSA(hashes.SHA256()))
    signed = SignedList(list=known, signature=base64.b64encode(signature).decode())
    _write(folder / LIST, msgspec.json.format(msgspec.json.encode(signed), indent=1) + b"\n", 0o644)


def _write_key(path: Path, key: EllipticCurvePrivateKey) -> None:
    from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat

    _write(path, key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()), 0o600)


def _write_pem(path: Path, certificate: x509.Certificate) -> None:
    from cryptography.hazmat.primitives.serialization import Encoding

    _write(path, certificate.public_bytes(Encoding.PEM), 0o644)


def _write(path: Path, data: bytes, mode: int) -> None:
    """Write a file whole or not at all; it has its mode before anything stands in it."""
    part = path.with_name(f".{path.name}.part")
    try:
        part.unlink(missing_ok=True)
        with open(part, "xb", opener=lambda name, flags: os.open(name, flags, mode)) as file:
            file.write(data)
        part.replace(path)
    except OSError as error:
        raise KeysError(f"{path}: cannot be written: {error.strerror}") from None
