"""From when to when the certificate of a member is valid, in words, as `gridpeers keys show` prints it."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

from gridpeers.wire.trust.certificate_files import KeysError, own_certificate
from gridpeers.wire.trust.member import DATE_AND_TIME, Member


def validity(folder: Path, member: Member, now: datetime) -> str:
    """Return the state of a member's certificate, with the times (UTC) at which it begins and ends.

    They are those of the certificate in the folder, as that is the one which a process here shows. Where it is not
    there, the end is that of the list of members, and its begin is not known.

    Parameters
    ----------
    folder : Path
        Folder of the site, or what was copied of it.
    member : Member
        Of its list.
    now : datetime
        Present time.

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
