"""Zenoh's access rules of a process, from the keys (`gridpeers.wire.keys.describe`) and the members of its site. Pure.

Everything is denied that no rule allows. Each other member is a subject of its own, by the common names under which it
is accepted, and has one policy; its rules name disjoint keys. So no two rules can apply to one message, and their order
decides nothing. A rule holds for one link: what the member at its other end may send here (ingress), and what is sent
to it (egress). Both ends check, so that neither depends on the other's honesty.

A message of a publication goes from a writer of its key to a reader. In a star the plant relays: on its links, messages
of all writers pass.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, Literal, NamedTuple

from gridpeers.wire.keys import ANY_TOKEN, KeySpec, describe
from gridpeers.wire.trust.member import Member

Flow = Literal["ingress", "egress"]

_FORWARD = {"publication": ("put",), "queryable": ("declare_queryable", "reply"), "token": ("liveliness_token",)}
"""Zenoh's messages from a writer of a kind of key to a reader."""

_BACK = {"publication": ("declare_subscriber",), "queryable": ("query",)}
"""Zenoh's messages from a reader to a writer; those of tokens are on a pattern over all of them."""

_WATCH = ("declare_liveliness_subscriber", "liveliness_query")


class Rule(NamedTuple):
    """Allowed messages on one link."""

    flow: Flow
    messages: tuple[str, ...]
    key: str
    """Key expression of Zenoh."""


def access_control(own: Member, members: Iterable[Member], *, star: bool = False) -> dict[str, Any]:
    """Return Zenoh's ``access_control`` for a process.

    Parameters
    ----------
    own : Member
        The process.
    members : Iterable[Member]
        Everybody with a certificate of the site, in any order. A name that stands in it twice counts once, revoked if
        one entry says so.
    star : bool, optional
        Whether the plant relays the messages of all others.

    Examples
    --------
    >>> plant, inv1 = Member(name="plant", role="plant"), Member(name="inv1", role="agent")
    >>> rules = access_control(plant, [inv1])
    >>> rules["default_permission"], rules["subjects"]
    ('deny', [{'id': 'agent:inv1', 'cert_common_names': ['agent:inv1', 'agent:inv1:2']}])
    """
    rules: list[dict[str, Any]] = []
    subjects: list[dict[str, Any]] = []
    policies: list[dict[str, Any]] = []
    for member in _each_once(members):
        subject = f"{member.role}:{member.name}"
        ids = []
        for number, rule in enumerate(rules_between(own, member, star=star)):
            ids.append(f"{subject} {number}")
            rules.append(
                {
                    "id": ids[-1],
                    "permission": "allow",
                    "flows": [rule.flow],
                    "messages": list(rule.messages),
                    "key_exprs": [rule.key],
                }
            )
        subjects.append({"id": subject, "cert_common_names": list(member.accepted)})
        policies.append({"id": subject, "rules": ids, "subjects": [subject]})
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    }


def rules_between(own: Member, other: Member, *, star: bool = False) -> tuple[Rule, ...]:
    """Return what a process allows on a link whose other end has the certificate of a member.

    Examples
    --------
    >>> inv1, inv2 = Member(name="inv1", role="agent"), Member(name="inv2", role="agent")
    >>> [rule.key for rule in rules_between(inv1, inv2) if rule.flow == "ingress" and "put" in rule.messages]
    ['gridpeers/*/state/inv2']
    """
    return tuple(_rules(own, other, star=star))


def _rules(own: Member, other: Member, *, star: bool) -> Iterator[Rule]:
    for spec in describe():
        ways: tuple[tuple[Flow, Member, Member], ...] = (("ingress", other, own), ("egress", own, other))
        for flow, sender, receiver in ways:
            if key := _key(spec, sender, receiver, star=star):
                yield Rule(flow, _FORWARD[spec.kind], key)
            if (key := _key(spec, receiver, sender, star=star)) and (back := _BACK.get(spec.kind)):
                yield Rule(flow, back, key)
    yield Rule("ingress", _WATCH, ANY_TOKEN)
    yield Rule("egress", _WATCH, ANY_TOKEN)


def _key(spec: KeySpec, writer: Member, reader: Member, *, star: bool) -> str:
    """Return the key on which messages of this kind go from one member to another; empty if none do."""
    relayed = star and writer.role == "plant"  # what it relays it may read itself, so the way to it needs no more
    if not ((relayed or writer.role in spec.writers) and reader.role in spec.readers):
        return ""
    inverter = "*"
    if "agent" in spec.writers and not relayed:
        inverter = writer.name
    elif spec.to_one_agent and reader.role == "agent":
        inverter = reader.name
    return spec.pattern(inverter)


def _each_once(members: Iterable[Member]) -> list[Member]:
    """Return the members in the order of role and name; of two entries of a name the later generation counts."""
    kept: dict[tuple[str, str], Member] = {}
    for member in members:
        place = member.role, member.name
        if place not in kept or (kept[place].generation, kept[place].revoked) < (member.generation, member.revoked):
            kept[place] = member
    return [kept[place] for place in sorted(kept)]
