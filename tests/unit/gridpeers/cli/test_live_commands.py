"""The commands for live runs: help, options, and one clear line with exit code 2 for what cannot be."""

from __future__ import annotations

import socket
from pathlib import Path
from typing import Any

import msgspec
import pytest

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.scenarios.live.live_options import configure
from gridpeers.scenarios.schema import load_scenario
from tests.command_line import invoke

pytestmark = pytest.mark.usefixtures("elsewhere")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["plant"], "missing argument 'SCENARIO'"),
        (["plant", "islandin"], 'no scenario "islandin"; did you mean "islanding"?'),
        (["plant", "islanding", "--case", "V"], '--case: no case "V"; did you mean "IV"?'),
        (
            ["plant", "islanding", "--listen", "tcp/192.0.2.1:1", "--insecure"],
            "--listen: tcp/192.0.2.1:1 cannot be listened on",
        ),
        (["plant", "islanding", "--speed", "0"], "--speed: must be from 0.1 to 50 (1 is real time), got 0"),
        (["plant", "islanding", "--wait", "nan"], "--wait: must be a time of at least 0 s, got nan s"),
        (["up", "islanding", "--for", "0"], "--for: must be a time of more than 0 s and at most 1e+09 s, got 0 s"),
        (["watch", "--for", "-1"], "--for: must be a time of more than 0 s and at most 1e+09 s, got -1 s"),
        (["up", "islanding", "--out", "full"], "--out full: the folder is not empty"),
        (["agent"], "missing argument 'INVERTER'"),
        (["agent", "inv 2"], 'INVERTER: "inv 2" cannot be part of a Zenoh key'),
        (["agent", "inv2", "--wait", "-3"], "--wait: must be a time of at least 0 s, got -3 s"),
        (["event", "toggle", "sw1_2"], "'toggle' is not one of 'open', 'close'"),
        (["load", "48"], "nothing is to be set; give --factor, or one or both of --P (kW) and --Q (kvar)"),
        (["load", "48", "--factor", "2", "--P", "9"], "--factor: goes with neither --P nor --Q"),
        (
            ["load", "48", "--factor", "-1"],
            "--factor: a factor on a load must not be negative, got -1; 0 to 10",
        ),
        (["load", "48", "--factor", "150"], "--factor: 150 is not plausible for a factor on a load (0 to 10)"),
        (["load", "48", "--Q", "nan"], "--Q: must be a finite number, got nan"),
    ],
)
def test_what_cannot_be_used_is_told_before_anything_starts(elsewhere: Path, words: list[str], said: str) -> None:
    """Exit code 2, where, what, and what would be right; no traceback, nothing written."""
    (elsewhere / "full").mkdir()
    (elsewhere / "full" / "mine.txt").write_text("mine")

    starts = words[0] in ("plant", "up") and "--listen" not in words  # a run of somebody may be at the default endpoint
    code, text = invoke(*words, *(["--listen", "tcp/127.0.0.1:0"] if starts else []))

    assert code == 2
    assert said in text
    assert "Traceback" not in text
    assert [path.name for path in elsewhere.iterdir()] == ["full"]


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


def test_the_plant_hands_every_agent_what_it_needs() -> None:
    """Each inverter, spare ones too, has a configuration of this run; the plant waits for those that are no spares."""
    wishes: dict[str, Any] = {"run": "lab", "case": "III", "speed": 2.0, "wait": 5.0, "duration": 1.0}
    plant, agents = configure(*load_scenario("islanding"), "tcp/127.0.0.1:7447", **wishes)
    handed = {name: msgspec.convert(tree, AgentConfig) for name, tree in plant.agent_configs.items()}

    assert plant.agents == tuple(f"inv{i}" for i in range(1, 10))
    assert plant.settings.spares == ("inv10",)
    assert (plant.clock, plant.speed, plant.wait_for_agents, plant.end) == ("wall", 2.0, 5.0, 1.0)
    assert tuple(handed.values()) == agents
    assert {agent.run for agent in agents} == {"lab"}
    assert {agent.control.graph for agent in agents} == {"GFM-only"}
    assert (handed["inv10"].microgrid, handed["inv10"].P_rated) == ("MG3", 350e3)
    assert handed["inv10"].name == "inv10"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["set", "inv1", "inv4"], "nothing is to be set; give one of --delay, --jitter (with --delay), --loss,"),
        (["set", "inv1 -> inv4", "--loss", "20"], "--loss: 20 is not plausible for the probability of a loss"),
        (["set", "inv1", "inv4", "--delay", "100"], "--delay: 100 s is not plausible for a delay (0 to 10 s); did"),
        (["set", "inv1", "inv4", "--delay", "0.1", "--jitter", "0.2"], "--jitter: must be above 0 s, and at most"),
        (["set", "inv1", "inv4", "--jitter", "0.2"], "--jitter: is around a delay; give --delay too"),
        (["set", "inv1", "inv4", "--profile", "lt"], '--profile: there is no profile "lt"; did you mean "lte"?'),
        (["set", "inv1", "inv4", "--loss", "0.1", "--for", "-1"], "--for: a time of the run must be above 0, got -1 s"),
        (["cut", "plant", "plant"], 'LINKS: "plant <-> plant" matches nothing: both ends are plant alone'),
        (["cut", "inv1"], 'LINKS: "inv1" names no links; write "inv4 <-> inv7"'),
        (["cut", "inv1", "inv4", "inv7"], 'LINKS: "inv1 inv4 inv7" is neither two names nor one pattern'),
        (["heal", "inv1", "-"], 'LINKS: the shell took the arrow for a redirection; put the pattern in quotes'),
    ],
)  # fmt: skip
def test_what_cannot_be_meant_is_told_before_a_run_is_sought(words: list[str], said: str) -> None:
    """Exit code 2, under the option that was typed, with what would be right."""
    code, text = invoke("link", *words)

    assert code == 2
    assert said in text
