"""What is said of a page without `--control`: that it only looks, and which options would let it act."""

from __future__ import annotations

from pathlib import Path

from gridpeers.wire.trust.credentials import Credentials
from gridpeers.wire.trust.key_folder import COMMANDING


def looks_only(credentials: Credentials | None) -> str:
    """Return that a page only looks, and what would let it act.

    A role that may not command gets no advice to say `--control` alone, which would be refused.

    Parameters
    ----------
    credentials : Credentials or None
        Of the one who opened the page; None of a run with open links.

    Examples
    --------
    >>> looks_only(None)
    'the page only looks (--control lets it act)'
    """
    if credentials is None or credentials.own.role in COMMANDING:
        return "the page only looks (--control lets it act)"
    folder = Path(credentials.certificate).parent
    may = (member.name for member in credentials.members if member.role in COMMANDING and not member.revoked)
    here = next((name for name in may if (folder / f"{name}.key").is_file()), None)
    way = f"--as {here} --control lets it act" if here else f"to act takes --control and the key of an {COMMANDING[0]}"
    return f"the page only looks, as {credentials.own.name} has the role {credentials.own.role} ({way})"
