"""Who a process is, whom it believes, and what each may say to whom: members, access rules, credentials. Pure.

A certificate's common name is ``role:name``, e.g. ``agent:inv4``, because Zenoh's access control knows a process by its
common name alone. A name whose certificate was revoked gets its next one in the next *generation*, ``agent:inv4:2``:
else the revoked certificate would count again.

Everything is denied that no rule allows. Each other member is a subject of its own, by the common names under which it
is accepted, and has one policy; its rules name disjoint keys. So no two rules can apply to one message, and their order
decides nothing. A rule holds for one link: what the member at its other end may send here (ingress), and what is sent
to it (egress). Both ends check, so that neither depends on the other's honesty. In a star the plant relays: on its
links, messages of all writers pass.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Literal, NamedTuple

import msgspec

from gridpeers.wire.keys import ANY_TOKEN, KEY_SPECS, KeySpec, Role
from gridpeers.wire.messages import PLANT
from gridpeers.wire.wording import printable

DATE_AND_TIME = "%Y-%m-%d %H:%M UTC"  # Form of the time at which a certificate ends: it may live for hours
LONGEST_COMMON_NAME = 64  # Characters of a common name (X.520, ub-common-name)


class SiteMember(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    name: str
    """Name of the member; an agent has the name of its inverter."""
    role: Role
    generation: int = 1
    """Number of the certificate: one more than the revoked certificates of this name."""
    revoked: bool = False
    expires: str = ""
    """When the certificate ends, to the minute, e.g. "2027-11-23 12:00 UTC"; empty if none was issued."""

    @property
    def common_name(self) -> str:
        return self._in_generation(self.generation)

    @property
    def accepted(self) -> tuple[str, ...]:
        """Common names under which others accept it, without the revoked one.

        The next generation is among them: it exists only once the site has issued it, and so a name that gets a new
        certificate can take part in a run that has begun before.
        """
        following = self._in_generation(self.generation + 1)
        return (following,) if self.revoked else (self.common_name, following)

    def _in_generation(self, number: int) -> str:
        return f"{self.role}:{self.name}" if number == 1 else f"{self.role}:{self.name}:{number}"


Flow = Literal["ingress", "egress"]

_FORWARD = {"publication": ("put",), "queryable": ("declare_queryable", "reply"), "token": ("liveliness_token",)}
"""Zenoh's messages from a writer of a kind of key to a reader."""

_BACK = {"publication": ("declare_subscriber",), "queryable": ("query",)}
"""Zenoh's messages from a reader to a writer; those of tokens are on a pattern over all of them."""

_WATCH = ("declare_liveliness_subscriber", "liveliness_query")


class Rule(NamedTuple):
    """Messages that are allowed on one link."""

    flow: Flow
    messages: tuple[str, ...]
    key: str
    """Key expression of Zenoh."""


def access_control(own: SiteMember, members: Iterable[SiteMember], *, star: bool = False) -> dict[str, Any]:
    """Return Zenoh's ``access_control`` for a process among all members of its site, in any order.

    In a star the plant relays all messages.
    """
    rules: list[dict[str, Any]] = []
    subjects: list[dict[str, Any]] = []
    policies: list[dict[str, Any]] = []
    for member in sorted(members, key=lambda member: (member.role, member.name)):
        subject = f"{member.role}:{member.name}"
        allowed = [
            {
                "id": f"{subject} {number}",
                "permission": "allow",
                "flows": [rule.flow],
                "messages": list(rule.messages),
                "key_exprs": [rule.key],
            }
            for number, rule in enumerate(rules_between(own, member, star=star))
        ]
        rules += allowed
        subjects.append({"id": subject, "cert_common_names": list(member.accepted)})
        policies.append({"id": subject, "rules": [rule["id"] for rule in allowed], "subjects": [subject]})
    return {"enabled": True, "default_permission": "deny", "rules": rules, "subjects": subjects, "policies": policies}


def rules_between(own: SiteMember, other: SiteMember, *, star: bool = False) -> list[Rule]:
    """Return what a process allows on a link whose other end has the certificate of a member."""
    rules = []
    for spec in KEY_SPECS:
        ways: tuple[tuple[Flow, SiteMember, SiteMember], ...] = (("ingress", other, own), ("egress", own, other))
        for flow, sender, receiver in ways:
            if key := _key(spec, sender, receiver, star=star):
                rules.append(Rule(flow, _FORWARD[spec.kind], key))
            if (key := _key(spec, receiver, sender, star=star)) and (back := _BACK.get(spec.kind)):
                rules.append(Rule(flow, back, key))
    return [*rules, Rule("ingress", _WATCH, ANY_TOKEN), Rule("egress", _WATCH, ANY_TOKEN)]


def _key(spec: KeySpec, writer: SiteMember, reader: SiteMember, *, star: bool) -> str:
    """Return the key on which messages of this kind go from one member to another; empty if none do."""
    relayed = star and writer.role == "plant"  # what it relays it may read itself, so the way to it needs no more
    if not ((relayed or writer.role in spec.writers) and reader.role in spec.readers):
        return ""
    if "agent" in spec.writers and not relayed:
        return spec.pattern(writer.name)
    return spec.pattern(reader.name if spec.to_one_agent and reader.role == "agent" else "*")


class Credentials(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Certificate of a process, and the members of its site."""

    own: SiteMember
    ca: str
    """Path of the certificate of the site's authority (PEM); the next two are paths of the own files."""
    certificate: str
    key: str
    members: tuple[SiteMember, ...]
    """Everybody with a certificate of the site, revoked ones included."""

    def knowing(self, inverters: tuple[str, ...]) -> Credentials:
        """Return the same with an agent for each of these inverters: their certificates may come during the run."""
        names = {member.name for member in self.members}
        later = tuple(SiteMember(name=name, role="agent") for name in dict.fromkeys(inverters) if name not in names)
        return msgspec.structs.replace(self, members=self.members + later)

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
        """Return why messages of the other end of a link are not believed, or "" for a member."""
        if any(common_name in member.accepted for member in self.members):
            return ""
        shown = printable(common_name, 64) or "nobody"
        if any(common_name == member.common_name for member in self.members):
            return f"its other end is {shown}, whose certificate was revoked"
        return f"its other end is {shown}, who is not on the list of members that was read at the start"

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


class LinkCertificates:
    """Note the certificates of a session's links."""

    def __init__(self, credentials: Credentials, *, relayed: bool) -> None:
        self._credentials, self._relayed = credentials, relayed
        self._names: set[str] = set()
        self._lines: list[str] = []

    def note(self, links: Iterable[Any]) -> None:
        """Note Zenoh's links; `auth_identifier` is the common name of the other end's certificate."""
        for link in links:
            name = link.auth_identifier or ""
            if name not in self._names:
                self._names.add(name)
                if why := self._credentials.stranger(name):
                    self._lines.append(f"a link to {link.dst}: {why}; no message passes")

    def take_lines(self) -> tuple[str, ...]:
        lines, self._lines = tuple(self._lines), []
        return lines

    def vouches(self, name: str) -> bool:
        """Return whether a link that was noted has had the certificate of a sender, the plant or an agent.

        Behind a relay everybody but the plant counts as vouched for: the relay lets each use its own keys alone.
        """
        if self._relayed and name != PLANT:
            return True
        return not self._names.isdisjoint(self._credentials.common_names(name))
