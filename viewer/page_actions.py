"""What a page may do to a run: each action is a command that can be typed, and is carried out as that command does."""

from __future__ import annotations

from itertools import chain
from typing import Any, Literal

import msgspec

from gridpeers.netem.fault_schedule import Heal
from gridpeers.netem.schema.fault import Fault
from gridpeers.scenarios.emulation.link_data import EVERYTHING, LinkCommand
from gridpeers.scenarios.live.run_address import RunAddress, UsageError, check_name
from gridpeers.scenarios.live.run_client import NobodyError, RunClient
from gridpeers.scenarios.live.run_requests import ask, check_link_command, command_links, links_of_run, load_setting
from gridpeers.scenarios.schema.scenario_writing import inline
from gridpeers.wire.messages import Text

ActionKind = Literal[
    "open", "close", "synchronise", "stop", "start", "cut", "delay", "loss", "heal", "heal all", "load"
]

FIND = 1.5  # Longest wait (s) for the plant of a run that the page follows already


class PageAction(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    kind: ActionKind
    subject: Text = ""
    """The switch, the agent, the load, or one end of the link."""
    other: Text = ""
    """The other end of the link; both ways."""
    value: float = 0.0
    """Delay (s) or probability of a loss."""
    factor: float | None = None
    P_kW: float | None = None
    Q_kvar: float | None = None

    def __post_init__(self) -> None:
        for name in (self.subject, self.other):
            if name.startswith("-"):  # the command that does the same would take it for an option
                raise ValueError(f"{name!r:.40} is not the name of a switch, load, inverter or agent")

    def words(self) -> list[str]:
        """Return the words of the command that does the same."""
        match self.kind:
            case "open" | "close":
                return ["event", self.kind, self.subject]
            case "synchronise":
                return ["event", "close", self.subject, "--synchronised"]
            case "stop":
                return ["stop", self.subject]
            case "start":
                return ["agent", self.subject]
            case "delay" | "loss":
                return ["link", "set", f"{self.subject} <-> {self.other}", f"--{self.kind}", _exact(self.value)]
            case "heal all":
                return ["link", "heal"]
            case "load":
                given = {"--factor": self.factor, "--P": self.P_kW, "--Q": self.Q_kvar}
                options = [(name, _exact(value)) for name, value in given.items() if value is not None]
                return ["load", self.subject, *chain.from_iterable(options)]
        return ["link", self.kind, self.subject, self.other]

    def fault(self) -> dict[str, Any]:
        """Return the entry of a scenario that does this to the link; without a model it only names it."""
        value = {"cut": True, "delay": self.value, "loss": self.value}.get(self.kind)
        return {"on": f"{self.subject} <-> {self.other}"} | ({} if value is None else {self.kind: value})

    def link_command(self) -> LinkCommand:
        if self.kind in ("heal", "heal all"):
            on = EVERYTHING if self.kind == "heal all" else self.fault()["on"]
            return LinkCommand(heal=Heal(on=on, from_s=0.0))
        return LinkCommand(fault=Fault(**self.fault()))


def _exact(value: float) -> str:
    return repr(value).removesuffix(".0")


class ActionClient:
    """Carry actions out, one after another, over a session of its own; all calls from one thread."""

    def __init__(self, where: RunAddress) -> None:
        self._where = where
        self._client: RunClient | None = None

    def perform(self, action: PageAction) -> str:
        """Carry out an action other than to start an agent; return its effect, or raise what says why it cannot be."""
        client = self._at_the_run()
        match action.kind:
            case "open" | "close" | "synchronise" | "stop":
                return ask(client, action.kind, action.subject)
            case "load":
                setting = load_setting(action.factor, action.P_kW, action.Q_kvar)
                return ask(client, "load", action.subject, setting)
        for name in (action.subject, action.other):
            if action.kind != "heal all":
                check_name("LINKS", name)
        command = action.link_command()
        check_link_command(command, links_of_run(client))
        result = command_links(client, command)
        if result.failures:
            raise UsageError("; ".join([result.text, *result.failures]))
        return result.text

    def close(self) -> None:
        if self._client is not None:
            self._client.close()

    def _at_the_run(self) -> RunClient:
        if self._client is None:
            self._client = RunClient(self._where)
        for _ in self._client.take(0.0):  # tokens that went since the last action
            pass
        try:
            self._client.find_plant(FIND)
        except NobodyError:
            self._client.renew()
            raise
        return self._client


def scenario_form(action: PageAction) -> str:
    """Return the lines of an entry of a scenario file, without its time; empty if an action ends another entry.

    An entry `[[event]]` needs a label and t_s beside, and `[[link]]` takes from_s and to_s; to heal a link is to_s of
    the entry that cuts it.
    """
    match action.kind:
        case "open" | "close":
            keys: dict[str, Any] = {action.kind: [action.subject]}
        case "synchronise":
            keys = {"close": [action.subject], "synchronised": True}
        case "stop" | "start":
            keys = {"leave" if action.kind == "stop" else "join": [action.subject]}
        case "load":
            given = {"factor": action.factor, "P_kW": action.P_kW, "Q_kvar": action.Q_kvar}
            keys = {"load": {action.subject: {key: value for key, value in given.items() if value is not None}}}
        case "heal" | "heal all":
            return ""
        case _:
            keys = action.fault()
    table = "link" if "on" in keys else "event"
    return "\n".join([f"[[{table}]]", *(f"{key} = {inline(value)}" for key, value in keys.items())])
