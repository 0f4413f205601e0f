"""The certificates of a session's links: whom they vouch for, and what is told of strangers."""

from __future__ import annotations

from typing import NamedTuple

from gridpeers.wire.trust.link_certificates import LinkCertificates
from tests.unit.wire.trust.test_credentials import SHOWN


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
        "a link to tls/192.0.2.1:5: its other end is operator:eve, whose certificate was revoked; nothing passes on it",
    )
    assert certificates.take_lines() == ()
