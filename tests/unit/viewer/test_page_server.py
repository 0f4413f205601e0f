"""Who may open the page, and what its server takes and gives."""

from __future__ import annotations

import asyncio
from typing import Any, cast

import pytest

from gridpeers.scenarios.live.run_address import UsageError
from gridpeers.viewer.page_server import access, texts

pytest.importorskip("uvicorn", reason="the page needs the extra view")


class Socket:
    """A page that sends this, and goes."""

    def __init__(self, *messages: dict[str, Any]) -> None:
        self._messages = list(messages)

    async def receive(self) -> dict[str, Any]:
        """The next message, as starlette has it."""
        return self._messages.pop(0)


def test_bytes_are_nobodys_question_and_end_nothing() -> None:
    """A binary message is passed over, as are texts that nobody understands; what comes behind it is read."""
    kind = "websocket.receive"
    page = Socket(
        {"type": kind, "bytes": b"x"},
        {"type": kind, "text": None, "bytes": b"y"},
        {"type": kind, "text": "z"},
        {"type": "websocket.disconnect", "code": 1000},
    )

    async def read() -> list[str]:
        return [text async for text in texts(cast(Any, page))]

    assert asyncio.run(read()) == ["z"]


@pytest.mark.parametrize("address", ["0.0.0.0", "::", "lab.example"])
def test_beyond_this_host_a_token_is_asked_for(address: str) -> None:
    """It is made up, another one each time, unless one is given; the page answers under any name."""
    first, second = access(address, ""), access(address, "")

    assert len(first[0]) >= 20
    assert first[0] != second[0]
    assert first[1] == ()
    assert access(address, "mine") == ("mine", ())


@pytest.mark.parametrize("address", ["127.0.0.1", "localhost", "::1"])
def test_on_this_host_no_token_is_needed_but_a_name_of_this_host_is(address: str) -> None:
    """A page of others reaches it under no name of theirs."""
    token, hosts = access(address, "")

    assert token == ""
    assert {"127.0.0.1", "localhost", "[::1]"} <= set(hosts)
    assert access(address, "mine")[0] == "mine"


def test_a_token_of_no_text_is_refused() -> None:
    """Bytes of a command line that are no UTF-8 can be typed into no page."""
    with pytest.raises(UsageError, match="--token: is not text"):
        access("127.0.0.1", "a\udcff")
