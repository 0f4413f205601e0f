"""Credentials: certificates, access rules of each role, and reports on strangers."""

from __future__ import annotations

import json
from itertools import combinations, permutations
from typing import NamedTuple

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gridpeers.wire.keys import KEY_SPECS, Keys, Role
from gridpeers.wire.trust.credentials import (
    Credentials,
    LinkCertificates,
    Rule,
    SiteMember,
    access_control,
    rules_between,
)

PLANT, OPERATOR, VIEWER = (SiteMember(name=role, role=role) for role in ("plant", "operator", "viewer"))
INV1, INV2, INV3 = (SiteMember(name=f"inv{k}", role="agent") for k in (1, 2, 3))
ALL = (PLANT, OPERATOR, VIEWER, INV1, INV2, INV3)
DEMO = Keys("demo")
CONCRETE = tuple(
    spec.expression.replace("<run>", "demo").replace("<inverter>", name).replace("<instance>", "a1")
    .replace("<epoch>", "7").replace("<recorder>", "history").replace("<id>", "z1")
    for spec in KEY_SPECS
    for name in ("inv1", "inv2", "inv9")
)  # fmt: skip
zenoh = pytest.importorskip("zenoh")


def allowed(rules: list[Rule], flow: str, message: str, key: str) -> int:
    expression = zenoh.KeyExpr(key)
    return sum(
        rule.flow == flow and message in rule.messages and zenoh.KeyExpr(rule.key).includes(expression)
        for rule in rules
    )


def puts(sender: SiteMember, receiver: SiteMember, *, star: bool = False) -> set[str]:
    rules = rules_between(receiver, sender, star=star)
    return {"/".join(key.split("/")[2:]) for key in CONCRETE if allowed(rules, "ingress", "put", key)}


@pytest.mark.parametrize("star", [False, True])
def test_both_ends_of_a_link_allow_the_same_and_no_two_rules_can_apply_to_one_message(star: bool) -> None:
    """A message that one end sends is accepted by the other. The keys of two rules for one message never overlap."""
    for own, other in permutations(ALL, 2):
        here, there = rules_between(own, other, star=star), rules_between(other, own, star=star)

        assert {(rule.messages, rule.key) for rule in here if rule.flow == "egress"} == {
            (rule.messages, rule.key) for rule in there if rule.flow == "ingress"
        }
        for a, b in combinations(here, 2):
            if a.flow == b.flow and {*a.messages} & {*b.messages}:
                assert not zenoh.KeyExpr(a.key).intersects(zenoh.KeyExpr(b.key)), (a, b)


@given(st.permutations(ALL), st.sampled_from(ALL), st.booleans())
def test_the_order_of_members_decides_nothing(members: list[SiteMember], own: SiteMember, star: bool) -> None:
    """Any order gives the same bytes."""
    assert json.dumps(access_control(own, members, star=star)) == json.dumps(access_control(own, ALL, star=star))


def test_each_role_publishes_only_what_is_its_own() -> None:
    """An agent publishes on its own keys, the plant measurements and reports of the run, an operator commands."""
    assert puts(INV1, PLANT) == {
        "ready/inv1", "state/inv1", "set_points/inv1", "report/inv1", "journal/inv1", "link_acknowledgement/inv1",
        "leave/inv1", "status/inv1", "request",
    }  # fmt: skip
    assert puts(INV1, INV2) == {"state/inv1"}
    assert puts(PLANT, INV1) == {
        "control", "stop_request/inv1/a1", "measurement/inv1", "link_request/inv1", "answer/z1",
    }  # fmt: skip
    assert puts(PLANT, VIEWER) == puts(PLANT, OPERATOR) == {"telemetry", "answer/z1"}
    assert puts(OPERATOR, PLANT) == {"command", "request"}
    assert puts(VIEWER, PLANT) == {"request"}
    assert [puts(person, agent) for person in (OPERATOR, VIEWER) for agent in (INV1, INV2)] == [set()] * 4
    assert puts(INV1, OPERATOR) == puts(INV1, VIEWER) == {"status/inv1"}
    assert puts(OPERATOR, VIEWER) == puts(VIEWER, OPERATOR) == set()


def test_a_relay_passes_on_to_each_what_it_may_hear_and_takes_from_each_its_own() -> None:
    """In a star an agent hears its neighbours over the plant's link; the plant still takes only an agent's own keys."""
    assert {"state/inv2", "state/inv9", "measurement/inv1"} <= puts(PLANT, INV1, star=True)
    assert "measurement/inv2" not in puts(PLANT, INV1, star=True)
    assert not {"state/inv2", "measurement/inv1", "control"} & puts(INV1, PLANT, star=True)
    assert "command" not in puts(VIEWER, PLANT, star=True)


@pytest.mark.parametrize("role", ["plant", "agent", "operator", "viewer"])
def test_nobody_holds_a_token_or_answers_a_query_for_another(role: Role) -> None:
    """An agent holds its own token and answers for its own nameplate. Only its agent gets a configuration."""
    member = SiteMember(name="inv1" if role == "agent" else role, role=role)
    rules = rules_between(INV2, member)
    held = {key for key in CONCRETE if allowed(rules, "ingress", "liveliness_token", key)}
    answered = {key for key in CONCRETE if allowed(rules, "ingress", "reply", key)}

    recorder, own = DEMO.alive_recorder("history"), DEMO.alive_agent("inv1", "a1")
    assert held == {
        "plant": {DEMO.alive_plant(7), recorder}, "agent": {own}, "operator": {recorder}, "viewer": set(),
    }[role]  # fmt: skip
    assert answered == {"plant": {DEMO.config("inv2")}, "agent": {DEMO.nameplate("inv1", "a1")}}.get(role, set())


@pytest.mark.parametrize("star", [False, True])
def test_an_agent_asks_for_no_configuration_but_its_own(star: bool) -> None:
    """Operators and viewers ask for all configurations. An agent asks for the nameplates of the others."""

    def asked(member: SiteMember, of: SiteMember) -> set[str]:
        rules = rules_between(of, member, star=star)
        return {"/".join(key.split("/")[2:]) for key in CONCRETE if allowed(rules, "ingress", "query", key)}

    configurations = {f"config/{name}" for name in ("inv1", "inv2", "inv9")}
    assert configurations & asked(INV1, PLANT) == {"config/inv1"}
    assert configurations <= asked(OPERATOR, PLANT)
    assert configurations <= asked(VIEWER, PLANT)
    assert asked(INV1, INV2) == {"nameplate/inv2/a1"}
    assert not allowed(rules_between(PLANT, INV1, star=star), "ingress", "query", DEMO.config("*"))


def test_a_revoked_name_has_no_rule_until_its_next_certificate() -> None:
    """Its common name has no rule. The next generation has rules, before and after its certificate is issued."""
    revoked = SiteMember(name="inv1", role="agent", revoked=True)
    again = SiteMember(name="inv1", role="agent", generation=2)

    def names(*members: SiteMember) -> list[list[str]]:
        return [subject["cert_common_names"] for subject in access_control(PLANT, members)["subjects"]]

    assert names(INV1) == [["agent:inv1", "agent:inv1:2"]]
    assert names(revoked) == [["agent:inv1:2"]]
    assert names(again) == [["agent:inv1:2", "agent:inv1:3"]]


def test_an_agent_whose_certificate_comes_later_has_its_rules_now() -> None:
    """Inverters of the feeder are subjects though nobody has their certificates; a name with another role keeps it."""
    known = (PLANT, SiteMember(name="inv2", role="viewer"))
    later = msgspec.structs.replace(SHOWN, members=known).knowing(("inv1", "inv2"))

    subjects = [subject["id"] for subject in access_control(INV3, later.members)["subjects"]]

    assert subjects == ["agent:inv1", "plant:plant", "viewer:inv2"]


REVOKED = SiteMember(name="eve", role="operator", revoked=True)
PLANTS = (SiteMember(name="plant", role="plant"), SiteMember(name="second", role="plant", generation=3))
SHOWN = Credentials(
    own=INV1, ca="ca.pem", certificate="inv1.pem", key="inv1.key", members=(INV1, REVOKED, *PLANTS)
).knowing(("inv1", "inv2"))


def test_links_are_mutual_tls_alone_and_end_with_a_certificate() -> None:
    """Both ends show a certificate, no other protocol is there, and a link closes when a certificate expires."""
    link, rules = SHOWN.zenoh_settings(star=False)
    tls = link["tls"]

    assert link["protocols"] == ["tls"]
    assert (tls["enable_mtls"], tls["close_link_on_expiration"], tls["root_ca_certificate"]) == (True, True, "ca.pem")
    assert {tls[f"{way}_certificate"] for way in ("listen", "connect")} == {"inv1.pem"}
    assert {tls[f"{way}_private_key"] for way in ("listen", "connect")} == {"inv1.key"}
    assert (rules["enabled"], rules["default_permission"]) == (True, "deny")


def test_a_sender_has_the_certificate_of_its_own_name() -> None:
    """An agent that of its inverter, in this generation or the next; the plant that of any plant of the site."""
    assert SHOWN.common_names("inv1") == {"agent:inv1", "agent:inv1:2"}
    assert SHOWN.common_names("inv2") == {"agent:inv2", "agent:inv2:2"}
    assert SHOWN.common_names("eve") == SHOWN.common_names("second") == frozenset()
    assert SHOWN.common_names("plant") == {"plant:plant", "plant:plant:2", "plant:second:3", "plant:second:4"}


class _Link(NamedTuple):
    auth_identifier: str | None
    dst: str = "tls/127.0.0.1:1"


def test_a_link_vouches_for_the_name_of_its_certificate_also_once_it_is_gone() -> None:
    """Nobody else is vouched for, and a link without a certificate vouches for nobody."""
    certificates = LinkCertificates(SHOWN, relayed=False)

    certificates.note([_Link(None)])
    assert not certificates.vouches("inv1")
    certificates.note([_Link("agent:inv1:2")])
    assert certificates.vouches("inv1")
    certificates.note([])
    assert certificates.vouches("inv1")
    assert not certificates.vouches("inv2")
    assert not certificates.vouches("plant")


def test_behind_a_relay_only_the_plant_needs_a_certificate_of_its_own_link() -> None:
    """No link shows an agent's certificate there; the relay keeps each to its own keys."""
    certificates = LinkCertificates(SHOWN, relayed=True)

    assert certificates.vouches("inv1")
    assert not certificates.vouches("plant")
    certificates.note([_Link("plant:plant")])
    assert certificates.vouches("plant")


def test_a_link_of_a_stranger_is_told_once() -> None:
    """The line names address and reason; a member's link has none, and links that stay are not told again."""
    links = [_Link("agent:inv1"), _Link("operator:eve", "tls/192.0.2.1:5")]
    certificates = LinkCertificates(SHOWN, relayed=False)

    certificates.note(links)
    certificates.note(links)

    assert certificates.take_lines() == (
        "a link to tls/192.0.2.1:5: its other end is operator:eve, whose certificate was revoked; no message passes",
    )
    assert certificates.take_lines() == ()
