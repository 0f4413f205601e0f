"""The commands for live runs: help, options, and one clear line with exit code 2 for what cannot be."""

from __future__ import annotations

import socket

import pytest

from tests.command_line import invoke

pytestmark = pytest.mark.usefixtures("elsewhere")


@pytest.mark.parametrize(
    "words",
    [["agent", "inv2"], ["watch"], ["event", "open", "sw1_2"], ["view", "--port", "0"]],
    ids=lambda words: words[0],
)
def test_nobody_there_is_told_within_the_wait(words: list[str]) -> None:
    """The endpoint, how long it was tried, and what to do."""
    if words[0] == "view":
        pytest.importorskip("starlette", reason="the extra view is not installed")
        pytest.importorskip("websockets", reason="the extra view is not installed")
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))  # nobody listens, and nobody else gets the port meanwhile
        endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"

        code, text = invoke(*words, "--connect", endpoint, "--wait", "0.2")

    line = [line for line in text.splitlines() if line.startswith("gridpeers: ")]
    assert code == 2
    assert line == [
        f"gridpeers: nothing answers at {endpoint} within 0.2 s; start a plant there (gridpeers plant SCENARIO), "
        "or say by --connect where it is"
    ]


def test_something_that_listens_in_silence_is_told() -> None:
    """To start a plant there would not work: the port is in use, e.g. by a plant that is frozen."""
    with socket.socket() as mute:
        mute.bind(("127.0.0.1", 0))
        mute.listen()
        endpoint = f"tcp/127.0.0.1:{mute.getsockname()[1]}"

        code, text = invoke("down", "--connect", endpoint, "--wait", "0.2")

    assert code == 2
    assert f"gridpeers: something listens at {endpoint} but has said nothing within 0.2 s" in text
    assert "kill -CONT" in text
    assert "start a plant" not in text
