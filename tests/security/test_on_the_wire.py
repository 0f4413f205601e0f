"""What somebody sees who listens to the traffic of a run."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.security.capture import CannotCaptureError, Capture
from tests.toy.town import Town

WORDS = (b"P_set", b"Measurement", b"sender")
"""Parts of payloads, which msgpack writes as they are; keys stand on the wire only at the start."""

ENOUGH = 20_000
"""Bytes of the run's traffic (half a second of it carries some 15,000)."""


def captured(town: Town) -> bytes:
    """Return what passes at the plant's port: enough of it that every kind of message is in it many times."""
    try:
        with Capture(town.endpoint) as capture:
            town.until(lambda: len(capture.data) > ENOUGH, f"{ENOUGH} bytes captured at the plant's port")
    except CannotCaptureError as error:
        pytest.skip(f"packets cannot be captured here: {error}")
    return bytes(capture.data)


def test_no_payload_is_readable_on_the_wire(town: Town) -> None:
    """With certificates neither fields nor names stand in any packet."""
    data = captured(town)

    assert [word for word in WORDS if word in data] == []


def test_on_open_links_everything_is_readable(tmp_path: Path) -> None:
    """The same words stand in the packets of the same run without certificates."""
    with Town(2, tmp_path).all() as open_town:
        data = captured(open_town)

    assert [word for word in WORDS if word in data] == list(WORDS)
