"""Who may open the page, by the address at which it listens."""

from __future__ import annotations

import pytest

from gridpeers.scenarios.live.run_address import UsageError
from gridpeers.viewer.page_server import access


@pytest.mark.parametrize("address", ["0.0.0.0", "192.0.2.7", "::", "lab.example"])
def test_beyond_this_host_a_token_is_asked_for(address: str) -> None:
    """It is made up, another one each time, unless one is given; the page answers under any name."""
    first, second = access(address, ""), access(address, "")

    assert len(first[0]) >= 20
    assert first[0] != second[0]
    assert first[1] == ()
    assert access(address, "mine") == ("mine", ())


@pytest.mark.parametrize("address", ["127.0.0.1", "localhost", "::1", "127.0.0.2"])
def test_on_this_host_no_token_is_needed_but_a_name_of_this_host_is(address: str) -> None:
    """A page of others reaches it under no name of theirs."""
    token, hosts = access(address, "")

    assert token == ""
    assert {"127.0.0.1", "localhost", "[::1]"} <= set(hosts)
    assert access(address, "mine")[0] == "mine"


def test_a_token_of_no_text_is_refused() -> None:
    """Bytes of a command line that are no UTF-8 can be typed into no page."""
    with pytest.raises(UsageError, match="--token: has bytes that are no text"):
        access("127.0.0.1", "a\udcff")
