"""What a page sends to its server."""

from __future__ import annotations

import asyncio
from typing import Any, cast

from gridpeers.viewer.page_server import texts


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
