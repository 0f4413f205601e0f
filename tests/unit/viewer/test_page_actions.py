"""What a click does: the one request that it makes, which is that of the command that the page shows for it."""

from __future__ import annotations

import shlex
import subprocess
from collections.abc import Iterator
from pathlib import Path
from time import monotonic
from types import SimpleNamespace
from typing import Any, get_args

import msgspec
import pytest

from gridpeers.netem.schema.netem import Netem
from gridpeers.scenarios.emulation.link_data import EVERYTHING, EmulationConfig, LinkCommand
from gridpeers.scenarios.live.run_address import ENDPOINT, RUN, RunAddress
from gridpeers.scenarios.schema import load_scenario
from gridpeers.viewer.live_pages import OwnAgents, looks_only
from gridpeers.viewer.page_actions import ActionClient, ActionKind, PageAction, scenario_form
from gridpeers.wire.codec import decode, encode
from gridpeers.wire.driver.command_line import command_line
from gridpeers.wire.keys import Keys
from gridpeers.wire.messages import Answer, AnyMessage, Command, LoadSetting, Pacing
from gridpeers.wire.trust.key_folder import open_credentials
from gridpeers.wire.trust.site_authority import make_site
from tests.command_line import invoke
from tests.scenario_files import written
from tests.toy.toy_configs import agent_config

WHERE = RunAddress(run=RUN, connect=(ENDPOINT,))

BOTH = "inv1 <-> inv4"


class Plant:
    """Stands for a run with two agents and emulated links: notes each command, and says yes to it."""

    commands: list[Command]
    """What it was told, but for questions for its status."""

    def __init__(self, where: RunAddress, *, meet_agents: bool = False) -> None:
        self.where, self.keys, self.id = where, Keys(where.run), "1"
        self._waiting: list[tuple[str, bytes]] = []

    def __enter__(self) -> Plant:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def find_plant(self, wait: float) -> None:
        """It is there."""

    def fetch(self, key: str) -> None:
        links = EmulationConfig(netem=Netem(), microgrids={"inv1": "mg1", "inv4": "mg2"}).to_tree()
        config = msgspec.structs.replace(agent_config("inv1"), links=links)
        self._waiting.append((self.keys.config("inv1"), msgspec.json.encode(config)))

    def publish(self, key: str, payload: bytes) -> None:
        command = decode(payload)
        assert isinstance(command, Command)
        assert key == self.keys.for_verb(command.verb)
        data: dict[str, Any] = {"number": 1, "t": 2.0, "asked": ()}
        if command.verb == "status":
            pacing = Pacing(steps=1, late=0, p50=0.0, p95=0.0, p99=0.0, worst=0.0, slipped=0.0)
            data = {"phase": "running", "t": 2.0, "speed": 1.0, "pacing": msgspec.to_builtins(pacing)}
        else:
            self.commands.append(msgspec.structs.replace(command, seq=0))  # its number is drawn anew each time
        answer = Answer(sender="plant", epoch=1, seq=command.seq, t=2.0, ok=True, text="done", data=data)
        self._waiting.append((self.keys.answer(self.id), encode(answer)))

    def take(self, seconds: float) -> Iterator[tuple[str, bytes, float]]:
        while self._waiting:
            yield *self._waiting.pop(0), monotonic()

    def read(self, key: str, payload: bytes) -> AnyMessage:
        return decode(payload)


@pytest.fixture
def commands(monkeypatch: pytest.MonkeyPatch) -> list[Command]:
    """What the plant is told by the page, or by a command that is typed."""
    told: list[Command] = []
    monkeypatch.setattr(Plant, "commands", told, raising=False)
    monkeypatch.setattr("gridpeers.viewer.page_actions.RunClient", Plant)
    monkeypatch.setattr("gridpeers.scenarios.live.run_client.RunClient", Plant)
    return told


def fault(**kinds: float) -> dict[str, Any]:
    """A fault of both directions of the link, as it travels."""
    return {"fault": {"on": BOTH, **kinds}}


REQUESTS: list[tuple[PageAction, str, dict[str, Any]]] = [
    (PageAction(kind="open", subject="13-152"), "event open 13-152", {"verb": "open", "argument": "13-152"}),
    (PageAction(kind="close", subject="13-152"), "event close 13-152", {"verb": "close", "argument": "13-152"}),
    (
        PageAction(kind="synchronise", subject="13-152"),
        "event close 13-152 --synchronised",
        {"verb": "synchronise", "argument": "13-152"},
    ),
    (PageAction(kind="stop", subject="inv4"), "stop inv4", {"verb": "stop", "argument": "inv4"}),
    (
        PageAction(kind="load", subject="48", factor=1.5),
        "load 48 --factor 1.5",
        {"verb": "load", "argument": "48", "load": LoadSetting(factor=1.5)},
    ),
    (
        PageAction(kind="load", subject="48", P_kW=300.0, Q_kvar=-90.5),
        "load 48 --P 300 --Q -90.5",
        {"verb": "load", "argument": "48", "load": LoadSetting(P=3e5, Q=-90_500.0)},
    ),
    (
        PageAction(kind="cut", subject="inv1", other="inv4"),
        "link cut inv1 inv4",
        {"verb": "link", "link_command": fault(cut=True)},
    ),
    (
        PageAction(kind="delay", subject="inv1", other="inv4", value=1.0 / 3.0),  # not rounded in the command
        f"link set {BOTH!r} --delay 0.3333333333333333",
        {"verb": "link", "link_command": fault(delay=1.0 / 3.0)},
    ),
    (
        PageAction(kind="loss", subject="inv1", other="inv4", value=0.25),
        f"link set {BOTH!r} --loss 0.25",
        {"verb": "link", "link_command": fault(loss=0.25)},
    ),
    (
        PageAction(kind="heal", subject="inv1", other="inv4"),
        "link heal inv1 inv4",
        {"verb": "link", "link_command": {"heal": {"on": BOTH, "from_s": 0.0}}},
    ),
    (
        PageAction(kind="heal all"),
        "link heal",
        {"verb": "link", "link_command": {"heal": {"on": EVERYTHING, "from_s": 0.0}}},
    ),
]
"""Each action, the command that the page shows, and the fields of the request."""


def effect(command: Command) -> tuple[object, ...]:
    """What the plant does at a command: shorthands of link faults are resolved."""
    if not command.link_command:
        return command.verb, command.argument, command.load
    link_command = LinkCommand.of_tree(command.link_command)
    models = link_command.fault.models() if link_command.fault is not None else None
    return command.verb, link_command.on, models, link_command.for_s


@pytest.mark.parametrize(("action", "typed", "fields"), REQUESTS, ids=[typed for _, typed, _ in REQUESTS])
def test_an_action_and_its_command_make_the_same_request(
    action: PageAction, typed: str, fields: dict[str, Any], commands: list[Command]
) -> None:
    """It is the action's own, with number and unit; whoever copies the command into a terminal does it once more."""
    ActionClient(WHERE).perform(action)
    code, output = invoke(*action.words())

    assert shlex.join(action.words()) == typed
    assert code == 0, output
    expected = Command(sender="visitor", epoch=0, seq=0, t=0.0, reply_to="1", **fields)
    assert [effect(command) for command in commands] == [effect(expected)] * 2


def test_to_start_an_agent_is_the_command_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """The process is `gridpeers agent` at the run of the page."""
    begun: list[list[str]] = []

    def begin(command: list[str], **_: Any) -> Any:
        begun.append(command)
        return SimpleNamespace(pid=7, poll=lambda: None, send_signal=lambda signal: None, wait=lambda seconds: 0)

    monkeypatch.setattr(subprocess, "Popen", begin)
    where = RunAddress(run="lab", connect=("tcp/10.0.0.1:7447",))
    action = PageAction(kind="start", subject="inv4")
    agents = OwnAgents(where)
    text = agents.start(action.subject)
    agents.close()

    assert text == "inv4: its agent starts, process 7; it leaves when this view ends"
    (command,) = begun
    typed = shlex.split(command_line(*action.words(), *where.words))
    assert typed == ["gridpeers", "agent", "inv4", "--run", "lab", "--connect", "tcp/10.0.0.1:7447"]
    assert command[-len(typed) :] == typed


@pytest.mark.parametrize("name", ["--help", "-x"])
def test_a_name_is_no_option_of_its_command(name: str) -> None:
    """An agent of that name would be help on the terminal, and exit code 0 here."""
    for field in ("subject", "other"):
        with pytest.raises(msgspec.ValidationError, match="is not the name of a switch, load, inverter or agent"):
            msgspec.json.decode(msgspec.json.encode({"kind": "start", field: name}), type=PageAction)


def test_every_action_is_here() -> None:
    """An action of the page without a test of its request would be a way to do another one."""
    assert {action.kind for action, _, _ in REQUESTS} | {"start"} == set(get_args(ActionKind))


SCENARIO = """
[time]
end_s = 2.0
[case.IV]
secondary = "all"
graph = "full"
"""


@pytest.mark.parametrize(("kind", "value"), [("cut", 0.0), ("delay", 0.1), ("loss", 0.25)])
def test_a_fault_of_the_page_is_one_of_a_scenario(kind: Any, value: float, tmp_path: Path) -> None:
    """A link that is cut, or late, or loses messages, both ways; to heal it is the end of that entry."""
    form = scenario_form(PageAction(kind=kind, subject="inv1", other="inv4", value=value))
    scenario, _ = load_scenario(written(tmp_path, SCENARIO + form))

    (fault,) = scenario.netem.links
    assert (fault.on, set(fault.models())) == (BOTH, {kind})
    assert scenario_form(PageAction(kind="heal", subject="inv1", other="inv4")) == ""


def test_a_page_that_only_looks_names_what_would_let_the_same_person_act(elsewhere: Path) -> None:
    """An operator needs --control; a viewer another certificate, by name if its key is in the folder."""
    pytest.importorskip("cryptography", reason="certificates need the extra keys")
    make_site(Path("lab"))
    operator = open_credentials(Path("lab"), ("operator",))[0]
    viewer = open_credentials(Path("lab"), ("viewer",))[0]
    said = "the page is read-only, as viewer has the role viewer "

    assert looks_only(operator) == "the page is read-only (--control lets it act)"
    assert looks_only(viewer) == f"{said}(--as operator --control lets it act)"
    (elsewhere / "lab" / "operator.key").unlink()
    assert looks_only(viewer) == f"{said}(to act takes --control and the key of an operator)"
