"""What a process shows and whom it believes: settings of its links, names that a sender may have, strangers."""

from __future__ import annotations

from gridpeers.wire.trust.credentials import Credentials
from gridpeers.wire.trust.member import Member

INV1 = Member(name="inv1", role="agent")
REVOKED = Member(name="eve", role="operator", revoked=True)
PLANTS = (Member(name="plant", role="plant"), Member(name="second", role="plant", generation=3))
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


def test_why_the_holder_of_a_certificate_has_no_access_is_told() -> None:
    """Revoked, unknown, or without a name; whoever is accepted, also ahead of time, is none of these."""
    assert SHOWN.stranger("agent:inv1") == SHOWN.stranger("agent:inv2:2") == SHOWN.stranger("operator:eve:2") == ""
    assert SHOWN.stranger("operator:eve") == "its other end is operator:eve, whose certificate was revoked"
    assert SHOWN.stranger("agent:inv9") == (
        "its other end is agent:inv9, who is no member by the list that was read at the start"
    )
    assert SHOWN.stranger("").startswith("its other end is nobody, who is no member")
    assert SHOWN.stranger("a\nb").startswith(r"its other end is a\x0ab, who")
