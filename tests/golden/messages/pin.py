"""Write the bytes of all messages into messages.txt: `python -m tests.golden.messages.pin`."""

from __future__ import annotations

from pathlib import Path
from textwrap import wrap

from gridpeers.wire.codec import encode
from gridpeers.wire.messages import Message
from tests.golden.messages import message_values

FILE = Path(__file__).parent / "messages.txt"

WHOLE = tuple(map(message_values.filled, message_values.WHOLE))
LEAST = message_values.LEAST


def messages() -> dict[str, Message]:
    """Return the messages by type, and whether every field or the fewest are given."""
    return {f"{type(of).__name__} {how}": of for how, all_of in (("whole", WHOLE), ("least", LEAST)) for of in all_of}


if __name__ == "__main__":
    blocks = [f"{name}\n" + "\n".join(wrap(encode(of).hex(), 120)) for name, of in messages().items()]
    FILE.write_text("\n\n".join(blocks) + "\n", encoding="ascii")
