"""Every key expression of gridpeers, with its two ends.

All keys of a run are below ``gridpeers/<run>/``. An *instance* is one process that claims a name: the id of its Zenoh
session. The keys by which agents find each other contain it, so that two processes of one name stay distinct.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import lru_cache
from typing import Literal, get_args

import msgspec

from gridpeers.wire.messages import MOST_COUNT, is_name

Role = Literal["plant", "agent", "operator", "viewer"]
"""The part that a process may take in a run. A command line, a page and a recorder are operators or viewers."""

ROLES: tuple[Role, ...] = get_args(Role)

READING = ("status", "links", "telemetry")
"""Verbs of commands that change nothing: they have a key of their own, on which viewers may publish."""

LATEST_ONLY = ("measurement", "state", "set_points", "status")
"""Kinds of keys of which only the newest message matters: in real time a sender drops it rather than wait."""


ANY_ALIVE_PLANT = "gridpeers/*/alive/plant/*"
"""Tokens of the plants of all runs, for an error message that lists the running ones."""

ANY_TOKEN = "gridpeers/*/alive/**"  # All tokens of all runs


class KeySpec(msgspec.Struct, frozen=True):
    """One kind of key, for the protocol's documentation and for access rules (`gridpeers.wire.trust.credentials`)."""

    path: str
    kind: Literal["publication", "queryable", "token"]
    message: str
    writers: tuple[Role, ...]
    """Roles of members of a site that may publish, answer or hold it; an agent only with its own name in the key."""
    readers: tuple[Role, ...]
    when: str

    @property
    def expression(self) -> str:
        return f"gridpeers/<run>/{self.path}"

    @property
    def to_one_agent(self) -> bool:
        """Whether an agent may read it only with its own name in the key, or ask for it with that alone."""
        return self.kind != "token" and "<inverter>" in self.path and "agent" not in self.writers

    def pattern(self, inverter: str = "*") -> str:
        """Return Zenoh's key expression for these keys in all runs, of one inverter or of all."""
        return re.sub("<[a-z]+>", "*", self.expression.replace("<inverter>", inverter))


def check_name(what: str, name: str) -> None:
    if not is_name(name):
        raise ValueError(
            f'{what}: "{name}" cannot be part of a Zenoh key; use 1 to 64 letters, digits, "_", "-" or "."'
        )


def _of_one(kind: str) -> Callable[[Keys, str], str]:
    """Return the method for keys of a kind that end in a name: the inverter's, of `answer` the asker's."""
    return lru_cache(maxsize=4096)(lambda keys, name: f"{keys.prefix}{kind}/{name}")


def _of_process(kind: str) -> Callable[[Keys, str, str], str]:
    return lambda keys, name, instance: f"{keys.prefix}{kind}/{name}/{instance}"


class Keys:
    """The keys of one run; `KEY_SPECS` says what each is for."""

    def __init__(self, run: str) -> None:
        check_name("run", run)
        self.prefix = f"gridpeers/{run}/"
        self.control = f"{self.prefix}control"
        self.telemetry = f"{self.prefix}telemetry"
        self.command = f"{self.prefix}command"
        self.request = f"{self.prefix}request"
        self.feeder_map = f"{self.prefix}feeder_map"
        self.any_alive = f"{self.prefix}alive/**"

    measurement = _of_one("measurement")
    state = _of_one("state")
    set_points = _of_one("set_points")
    ready = _of_one("ready")
    leave = _of_one("leave")
    report = _of_one("report")
    journal = _of_one("journal")
    link_request = _of_one("link_request")
    link_acknowledgement = _of_one("link_acknowledgement")
    status = _of_one("status")
    config = _of_one("config")
    answer = _of_one("answer")
    alive_recorder = _of_one("alive/recorder")
    stop_request = _of_process("stop_request")
    nameplate = _of_process("nameplate")
    alive_agent = _of_process("alive/agent")

    def alive_plant(self, epoch: int | str) -> str:
        return f"{self.prefix}alive/plant/{epoch}"

    def for_verb(self, verb: str) -> str:
        return self.request if verb in READING else self.command

    def parts(self, key: str) -> tuple[str, ...]:
        """Split a key of this run into its parts after ``gridpeers/<run>/``; empty for any other key.

        It is also empty if a part is no name: anybody can hold a token of any text.
        """
        return _parts(self.prefix, key)


@lru_cache(maxsize=8192)
def _parts(prefix: str, key: str) -> tuple[str, ...]:
    parts = tuple(key[len(prefix) :].split("/")) if key.startswith(prefix) else ()
    return parts if all(map(is_name, parts)) else ()


MOST_PARTS = 6  # Parts of the longest token: that of an agent


def epoch_of(part: str) -> int | None:
    """Return the epoch in the last part of a plant's token; None if no message could have it.

    A leading zero is refused: else the end of a token alive/plant/07 would pass for the end of plant 7.
    """
    return int(part) if re.fullmatch("0|[1-9][0-9]{0,15}", part) and int(part) <= MOST_COUNT else None


def is_token(key: str) -> bool:
    parts = key.split("/", MOST_PARTS)
    return len(parts) <= MOST_PARTS and all(map(is_name, parts))


def run_of_plant(key: str) -> str:
    """Return the name of the run whose plant has this token; empty for any other key."""
    match key.split("/"):
        case ("gridpeers", run, "alive", "plant", _) if is_name(run):
            return run
    return ""


_PLANT: tuple[Role, ...] = ("plant",)
_AGENT: tuple[Role, ...] = ("agent",)
_PEOPLE: tuple[Role, ...] = ("plant", "operator", "viewer")  # the recorder on the plant's host has its certificate

KEY_SPECS = (
    KeySpec(
        "alive/plant/<epoch>", "token", "-", _PLANT, ROLES,
        "while the plant's session lives; declared after its subscribers; contains the plant's epoch",
    ),
    KeySpec(
        "alive/agent/<inverter>/<instance>", "token", "-", _AGENT, ROLES,
        "while the agent's session lives; declared after its subscribers and its queryable",
    ),
    KeySpec(
        "alive/recorder/<recorder>", "token", "-", ("plant", "operator"), ROLES,
        "until the final telemetry has arrived; declared after its subscriber",
    ),
    KeySpec(
        "nameplate/<inverter>/<instance>", "queryable", "Nameplate", _AGENT, ("plant", "agent"),
        "asked when a token appears; by a neighbour once more, as proof that its subscription has arrived",
    ),
    KeySpec(
        "control", "publication", "Prepare, Waiting, Stop", _PLANT, _AGENT,
        "before tick 0; at the end; while the plant waits",
    ),
    KeySpec(
        "stop_request/<inverter>/<instance>", "publication", "Stop", _PLANT, _AGENT,
        "when another agent holds its name, or no inverter has it; real time: on `gridpeers stop`",
    ),
    KeySpec(
        "ready/<inverter>", "publication", "Ready", _AGENT, _PLANT,
        "when every in-neighbour on the roster has answered",
    ),
    KeySpec("measurement/<inverter>", "publication", "Measurement", _PLANT, _AGENT, "at every tick: it is the grant"),
    KeySpec(
        "state/<inverter>", "publication", "State", _AGENT, ("plant", "agent"),
        "at every tick, after its measurement and the neighbours' states of the tick before",
    ),
    KeySpec(
        "set_points/<inverter>", "publication", "State", _AGENT, _PLANT,
        "real time: in place of state, when the law sends nothing to the neighbours",
    ),
    KeySpec(
        "telemetry", "publication", "Telemetry, LinkReport, Journal, LinkRequest", _PLANT, _PEOPLE,
        "at tick 0, every tenth tick (real time: every 0.2 s), and at the end",
    ),
    KeySpec(
        "report/<inverter>", "publication", "LinkReport", _AGENT, _PLANT,
        "in a run with emulated links: every 100 ticks, and when it ends (the plant publishes it on telemetry)",
    ),
    KeySpec(
        "journal/<inverter>", "publication", "Journal", _AGENT, _PLANT,
        "in a recorded run: when ages, weights or reasons of the used states change; real time: every 0.2 s (the "
        "plant publishes it on telemetry)",
    ),
    KeySpec(
        "link_request/<inverter>", "publication", "LinkRequest", _PLANT, _AGENT,
        "real time: at each link command, and all of them to an agent that joins; again every second, until it is "
        "acknowledged",
    ),
    KeySpec(
        "link_acknowledgement/<inverter>", "publication", "LinkAcknowledgement", _AGENT, _PLANT,
        "real time: one for every LinkRequest, in their order",
    ),
    KeySpec(
        "leave/<inverter>", "publication", "Leave", _AGENT, _PLANT,
        "real time: when the agent leaves; the plant then takes its inverter off the network",
    ),
    KeySpec(
        "status/<inverter>", "publication", "AgentStatus", _AGENT, _PEOPLE,
        "real time: every 0.5 s, and when its phase or its neighbours in use change",
    ),
    KeySpec(
        "config/<inverter>", "queryable", "-", _PLANT, ROLES,
        "real time: asked once the plant's token is there; its AgentConfig as JSON",
    ),
    KeySpec(
        "feeder_map", "queryable", "-", _PLANT, _PEOPLE,
        "real time: asked once the plant's token is there; buses, branches, switches, inverters as JSON",
    ),
    KeySpec(
        "command", "publication", "Command", ("operator",), _PLANT,
        "real time: once the plant's token is there, to change something",
    ),
    KeySpec(
        "request", "publication", "Command", ROLES, _PLANT,
        "real time: once the plant's token is there, to learn something (status, links, telemetry); simulated: by "
        "the recorder, after each Telemetry and every second",
    ),
    KeySpec(
        "answer/<id>", "publication", "Answer, LinkAcknowledgement", _PLANT, ROLES,
        "real time: one Answer for every command; to a link command every LinkAcknowledgement, too; simulated: to a "
        "recorder that asks again",
    ),
)  # fmt: skip
"""Every kind of key with its message, its two ends and its time; `gridpeers doc keys` prints it."""
