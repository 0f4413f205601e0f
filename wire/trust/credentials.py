"""What a process needs to prove who it is, and to know whom it may believe. Pure.

The private key stays in its file; only paths travel to the processes of a run.
"""

from __future__ import annotations

from typing import Any

import msgspec

from gridpeers.wire.messages import PLANT
from gridpeers.wire.printable import printable
from gridpeers.wire.trust.access_rules import access_control
from gridpeers.wire.trust.member import Member, with_inverters


class Credentials(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Certificate of a process, and the members of its site."""

    own: Member
    """Whom the certificate names."""
    ca: str
    """Path of the certificate of the site's authority (PEM)."""
    certificate: str
    """Path of the own certificate (PEM)."""
    key: str
    """Path of its private key (PEM)."""
    members: tuple[Member, ...]
    """Everybody with a certificate of the site, revoked ones included."""

    def knowing(self, inverters: tuple[str, ...]) -> Credentials:
        """Return the same with an agent for each of these inverters: their certificates may come during the run."""
        return msgspec.structs.replace(self, members=with_inverters(self.members, inverters))

    def common_names(self, sender: str) -> frozenset[str]:
        """Return the common names that a sender of messages may have, the plant or an agent."""
        role = "plant" if sender == PLANT else "agent"
        return frozenset(
            accepted
            for member in self.members
            if member.role == role and (role == "plant" or member.name == sender)
            for accepted in member.accepted
        )

    def stranger(self, common_name: str) -> str:
        """Return why the holder of a certificate that TLS has accepted has no access; empty if it has."""
        if any(common_name in member.accepted for member in self.members):
            return ""
        shown = printable(common_name, 64) or "nobody"
        if any(common_name == member.common_name for member in self.members):
            return f"its other end is {shown}, whose certificate was revoked"
        return f"its other end is {shown}, who is no member by the list that was read at the start"

    def zenoh_settings(self, *, star: bool) -> tuple[dict[str, Any], dict[str, Any]]:
        """Return Zenoh's settings ``transport/link`` and ``access_control``.

        Names of hosts are not verified: a member is known by its certificate's common name, wherever it listens, and
        each common name has its own rights. So an agent may listen at any address, and gossip may tell others of it.
        """
        tls = {
            "root_ca_certificate": self.ca,
            "enable_mtls": True,
            "verify_name_on_connect": False,
            "close_link_on_expiration": True,
            "listen_private_key": self.key,
            "listen_certificate": self.certificate,
            "connect_private_key": self.key,
            "connect_certificate": self.certificate,
        }
        return {"protocols": ["tls"], "tls": tls}, access_control(self.own, self.members, star=star)
