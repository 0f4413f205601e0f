"""The certificates that the links of a session have had: which senders they vouch for, and which are strange. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

from gridpeers.wire.messages import PLANT
from gridpeers.wire.trust.credentials import Credentials


class Link(Protocol):
    """A link of a session, as Zenoh describes it."""

    @property
    def auth_identifier(self) -> str | None:
        """Common name of the certificate of its other end; None without one."""

    @property
    def dst(self) -> object:
        """Address of its other end."""


class LinkCertificates:
    """Note the certificates of a session's links.

    Parameters
    ----------
    credentials : Credentials
        Members of the site.
    relayed : bool
        Whether all links lead through a relay. Only the plant's certificate can be seen then.
    """

    def __init__(self, credentials: Credentials, *, relayed: bool) -> None:
        self._credentials, self._relayed = credentials, relayed
        self._names: set[str] = set()
        """Common names of the certificates of all links so far."""
        self._lines: list[str] = []

    def note(self, links: Iterable[Link]) -> None:
        """Note the certificates of the present links."""
        for link in links:
            name = link.auth_identifier or ""
            if name not in self._names:
                self._names.add(name)
                if why := self._credentials.stranger(name):
                    self._lines.append(f"a link to {link.dst}: {why}; nothing passes on it")

    def take_lines(self) -> tuple[str, ...]:
        """Take out lines on links whose other end has a certificate and no access."""
        lines, self._lines = tuple(self._lines), []
        return lines

    def vouches(self, name: str) -> bool:
        """Return whether a link that was noted has had the certificate of a sender, the plant or an agent.

        Behind a relay everybody but the plant counts as vouched for: the relay lets each use its own keys alone.
        """
        if self._relayed and name != PLANT:
            return True
        return not self._names.isdisjoint(self._credentials.common_names(name))
