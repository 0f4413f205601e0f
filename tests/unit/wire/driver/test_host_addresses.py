"""The addresses of a host: a session is told to others at those of now, and given up when they change."""

from __future__ import annotations

from pathlib import Path

import pytest

from gridpeers.wire.driver.host_addresses import LinkAddresses, host_addresses, listed_addresses

OLD, NEW, OTHER = "10.9.0.2", "10.9.0.77", "10.8.0.1"
ANY = ("tcp/0.0.0.0:0",)


@pytest.mark.skipif(not Path("/proc/net/fib_trie").exists(), reason="this system lists no addresses in /proc")
def test_the_addresses_of_this_host_reach_others() -> None:
    """None is loopback; two looks see the same."""
    assert not any(text.startswith("127.") or text == "::1" for text in host_addresses())
    assert host_addresses() == host_addresses()


def test_a_system_that_lists_nothing_has_no_addresses() -> None:
    """Then a session listens as it is asked to, and stays."""
    assert listed_addresses("", "") == frozenset()
    known = LinkAddresses(ANY, ())
    assert (known.endpoints, known.moved({OLD}, ())) == (ANY, False)


@pytest.mark.parametrize(
    ("opened", "sources", "now", "moved"),
    [
        ({OLD}, {OLD}, {OLD}, False),
        ({OLD}, {OLD}, {NEW}, True),  # by DHCP
        ({OLD}, {OLD}, set(), False),  # the cable is out: nothing to be gained
        ({OLD, OTHER}, {OLD}, {OLD}, False),  # a network goes that no link uses
        ({OLD}, {OLD}, {OLD, OTHER}, False),  # one comes
        ({OLD}, set(), {NEW}, False),  # no link yet: nobody has been told anything
    ],
)
def test_a_session_is_given_up_once_its_links_have_lost_their_address(
    opened: set[str], sources: set[str], now: set[str], *, moved: bool
) -> None:
    """An address of a link is gone, and there is another one."""
    known = LinkAddresses(ANY, opened)
    assert not known.moved(sources, opened)
    assert known.moved(sources, now) is moved


@pytest.mark.parametrize("opened", [(), (OLD,)])
def test_a_session_that_is_told_to_others_at_no_address_of_its_links_is_given_up(opened: tuple[str, ...]) -> None:
    """It opened before the host had its address; the next session knows it, and stays."""
    assert LinkAddresses(ANY, opened).moved({NEW}, {NEW})
    assert not LinkAddresses(ANY, {NEW}).moved({NEW}, {NEW})
    assert not LinkAddresses((f"tcp/{OTHER}:7450",), opened).moved({NEW}, {NEW})
