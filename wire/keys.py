"""Every key expression of gridpeers, with its two ends.

All keys of a run are below ``gridpeers/<run>/``. An *instance* is one process that claims a name: the id of its Zenoh
session. The keys by which agents find each other contain it, so that two processes of one name stay distinct.
"""

from __future__ import annotations

import re
from functools import lru_cache
from typing import Any, Literal, get_args

import msgspec

from gridpeers.wire.bounds import MOST_COUNT, is_name

Role = Literal["plant", "agent", "operator", "viewer"]
"""The part that a process may take in a run. A command line, a page and a recorder are operators or viewers."""

ROLES: tuple[Role, ...] = get_args(Role)

READING = ("status", "links", "telemetry")
"""Verbs of commands that change nothing: they have a key of their own, on which viewers may publish."""

LATEST_ONLY = ("measurement", "state", "set_points", "status")
"""Kinds of keys of which only the newest message matters: in wall-clock time a sender drops it rather than wait."""


ANY_ALIVE_PLANT = "gridpeers/*/alive/plant/*"
"""Tokens of the plants of all runs, for an error message that lists the running ones."""

ANY_TOKEN = "gridpeers/*/alive/**"
"""All tokens of all runs."""


class KeySpec(msgspec.Struct, frozen=True):
    """One kind of key, for the protocol's documentation and for access rules (`gridpeers.wire.trust.credentials`)."""

    expression: str
    """The key, with its parts in angle brackets."""
    kind: Literal["publication", "queryable", "token"]
    """publication, queryable or token (of liveliness)."""
    message: str
    """Type of the message, or "-" for a token."""
    sender: str
    """The participant that publishes, answers or holds it."""
    listener: str
    """The participants that subscribe, query or watch."""
    when: str
    """Time at which it is sent or held."""
    writers: tuple[Role, ...]
    """Roles of members of a site that may publish, answer or hold it; an agent only with its own name in the key."""
    readers: tuple[Role, ...]
    """Roles that may subscribe, query or watch."""

    @property
    def to_one_agent(self) -> bool:
        """Whether an agent may read it only with its own name in the key, or ask for it with that alone."""
        return self.kind != "token" and "<inverter>" in self.expression and "agent" not in self.writers

    def pattern(self, inverter: str = "*") -> str:
        """Return Zenoh's key expression for these keys in all runs, of one inverter or of all."""
        return re.sub("<[a-z]+>", "*", self.expression.replace("<inverter>", inverter))


def check_name(what: str, name: str) -> None:
    """Raise ValueError if a name cannot be a part of a key."""
    if not is_name(name):
        raise ValueError(
            f'{what}: "{name}" cannot be part of a Zenoh key; use 1 to 64 letters, digits, "_", "-" or "."'
        )


class Keys:
    """The keys of one run."""

    def __init__(self, run: str) -> None:
        check_name("run", run)
        self._root = f"gridpeers/{run}"
        self.prefix = f"{self._root}/"
        """Beginning of every key of the run."""
        self.control = f"{self._root}/control"
        self.telemetry = f"{self._root}/telemetry"
        self.command = f"{self._root}/command"
        self.request = f"{self._root}/request"
        self.feeder_map = f"{self._root}/feeder_map"
        self.any_alive = f"{self._root}/alive/**"

    def measurement(self, inverter: str) -> str:
        """Return the key of an inverter's sensor readings, which grant a tick."""
        return f"{self._root}/measurement/{inverter}"

    def state(self, inverter: str) -> str:
        """Return the key of an agent's states."""
        return f"{self._root}/state/{inverter}"

    def set_points(self, inverter: str) -> str:
        """Return the key of an agent's states that are not for its neighbours (wall-clock time)."""
        return f"{self._root}/set_points/{inverter}"

    def ready(self, inverter: str) -> str:
        """Return the key on which an agent says that it hears its neighbours."""
        return f"{self._root}/ready/{inverter}"

    def leave(self, inverter: str) -> str:
        """Return the key on which an agent says that it leaves properly."""
        return f"{self._root}/leave/{inverter}"

    def report(self, inverter: str) -> str:
        """Return the key of reports on the emulated links into an agent."""
        return f"{self._root}/report/{inverter}"

    def journal(self, inverter: str) -> str:
        """Return the key of an agent's journal."""
        return f"{self._root}/journal/{inverter}"

    def link_request(self, inverter: str) -> str:
        """Return the key of commands to the emulated links into an agent."""
        return f"{self._root}/link_request/{inverter}"

    def link_acknowledgement(self, inverter: str) -> str:
        """Return the key of an agent's acknowledgements of link requests."""
        return f"{self._root}/link_acknowledgement/{inverter}"

    def status(self, inverter: str) -> str:
        """Return the key of an agent's status."""
        return f"{self._root}/status/{inverter}"

    def config(self, inverter: str) -> str:
        """Return the key of a queryable: the configuration of an agent."""
        return f"{self._root}/config/{inverter}"

    def answer(self, asker: str) -> str:
        """Return the key of the answers to a client's commands."""
        return f"{self._root}/answer/{asker}"

    def stop_request(self, inverter: str, instance: str) -> str:
        """Return the key of stop requests to one instance."""
        return f"{self._root}/stop_request/{inverter}/{instance}"

    def nameplate(self, inverter: str, instance: str) -> str:
        """Return the key of a queryable: the nameplate of one instance."""
        return f"{self._root}/nameplate/{inverter}/{instance}"

    def alive_plant(self, epoch: int | str) -> str:
        """Return the key of a plant's token, which contains its epoch."""
        return f"{self._root}/alive/plant/{epoch}"

    def alive_agent(self, inverter: str, instance: str) -> str:
        """Return the key of an agent's token."""
        return f"{self._root}/alive/agent/{inverter}/{instance}"

    def alive_recorder(self, recorder: str) -> str:
        """Return the key of a recorder's token."""
        return f"{self._root}/alive/recorder/{recorder}"

    def for_verb(self, verb: str) -> str:
        """Return the key of a command, by its verb: that of requests if it changes nothing."""
        return self.request if verb in READING else self.command

    def parts(self, key: str) -> tuple[str, ...]:
        """Split a key of this run into its parts after ``gridpeers/<run>/``; empty for any other key.

        It is also empty if a part is no name: anybody can hold a token of any text.
        """
        return _parts(self._root, key)


@lru_cache(maxsize=8192)
def _parts(root: str, key: str) -> tuple[str, ...]:
    """Split a key; cached, because in one process every node sees the same tokens."""
    parts = tuple(key[len(root) + 1 :].split("/")) if key.startswith(f"{root}/") else ()
    return parts if all(map(is_name, parts)) else ()


MOST_PARTS = 6
"""Parts of the longest token: that of an agent."""


def epoch_of(part: str) -> int | None:
    """Return the epoch in the last part of a plant's token; None if no message could have it.

    An epoch has one text: else the end of another one's token, with a zero before, would be that of the plant.

    Examples
    --------
    >>> epoch_of("1763778000000"), epoch_of("late"), epoch_of("9" * 30), epoch_of("01763778000000")
    (1763778000000, None, None, None)
    """
    return int(part) if re.fullmatch("0|[1-9][0-9]{0,15}", part) and int(part) <= MOST_COUNT else None


def is_token(key: str) -> bool:
    """Whether a key can be that of a process's token, as long as those are."""
    parts = key.split("/", MOST_PARTS)
    return len(parts) <= MOST_PARTS and all(map(is_name, parts))


def run_of_plant(key: str) -> str:
    """Return the name of the run whose plant has this token; empty for any other key.

    Examples
    --------
    >>> run_of_plant("gridpeers/demo/alive/plant/1")
    'demo'
    """
    match key.split("/"):
        case ("gridpeers", run, "alive", "plant", _) if is_name(run):
            return run
    return ""


_PARTS_SHOWN = {
    "RUN": "run", "INV": "inverter", "INSTANCE": "instance", "EPOCH": "epoch", "NAME": "recorder", "ASKER": "id",
}  # fmt: skip
"""Parts of a key that differ, as `describe` makes the key with them and as it shows them."""


def describe() -> tuple[KeySpec, ...]:
    """Every kind of key with its message, its two ends and its time; `gridpeers doc keys` prints it."""
    keys = Keys("RUN")

    def row(key: str, *rest: Any) -> KeySpec:
        """Return the row of a key; `rest` are the other fields, in their order."""
        for name, shown in _PARTS_SHOWN.items():
            key = key.replace(name, f"<{shown}>")
        return KeySpec(key, *rest)

    agent, instance = "INV", "INSTANCE"
    by_plant: tuple[Role, ...] = ("plant",)
    by_agent: tuple[Role, ...] = ("agent",)
    people: tuple[Role, ...] = ("plant", "operator", "viewer")  # the recorder on the plant's host has its certificate
    return (
        row(
            keys.alive_plant("EPOCH"), "token", "-", "plant", "agents, recorders",
            "as long as the plant's session lives; declared after its subscribers; says the epoch of its messages",
            by_plant, ROLES,
        ),
        row(
            keys.alive_agent(agent, instance), "token", "-", "agent", "plant, other agents",
            "while the agent's session lives; declared after its subscribers and its queryable",
            by_agent, ROLES,
        ),
        row(
            keys.alive_recorder("NAME"), "token", "-", "recorder", "plant",
            "until the final telemetry is in; declared after its subscriber",
            ("plant", "operator"), ROLES,
        ),
        row(
            keys.nameplate(agent, instance), "queryable", "Nameplate", "agent", "plant, other agents",
            "asked when a token appears; by a neighbour once more, as proof that its subscription has arrived",
            by_agent, ("plant", "agent"),
        ),
        row(
            keys.control, "publication", "Prepare, Waiting, Stop", "plant", "agents",
            "before tick 0; at the end; while the plant waits",
            by_plant, by_agent,
        ),
        row(
            keys.stop_request(agent, instance), "publication", "Stop", "plant", "the one instance",
            "when its name is taken or is no inverter of the feeder; wall-clock: on `gridpeers stop`",
            by_plant, by_agent,
        ),
        row(
            keys.ready(agent), "publication", "Ready", "agent", "plant",
            "when it has proof to hear every in-neighbour on the roster",
            by_agent, by_plant,
        ),
        row(
            keys.measurement(agent), "publication", "Measurement", "plant", "agent", "at every tick: it is the grant",
            by_plant, by_agent,
        ),
        row(
            keys.state(agent), "publication", "State", "agent", "plant, neighbours",
            "at every tick, once its measurement and the neighbours' states of the tick before are in",
            by_agent, ("plant", "agent"),
        ),
        row(
            keys.set_points(agent), "publication", "State", "agent", "plant",
            "wall-clock: instead of state, at a tick at which the law sends nothing to the neighbours",
            by_agent, by_plant,
        ),
        row(
            keys.telemetry, "publication", "Telemetry, LinkReport, Journal, LinkRequest", "plant", "recorders",
            "at tick 0, every tenth tick (wall-clock: every 0.2 s), and at the end",
            by_plant, people,
        ),
        row(
            keys.report(agent), "publication", "LinkReport", "agent", "plant, which publishes it on telemetry",
            "in a run with emulated links: every 100 ticks, and when it ends",
            by_agent, by_plant,
        ),
        row(
            keys.journal(agent), "publication", "Journal", "agent", "plant, which publishes it on telemetry",
            "in a recorded run: when the way in which the agent decides changes; wall-clock: every 0.2 s",
            by_agent, by_plant,
        ),
        row(
            keys.link_request(agent), "publication", "LinkRequest", "plant", "agent",
            "wall-clock: at each link command, and all of them to an agent that joins; again "
            "every second, until it is acknowledged",
            by_plant, by_agent,
        ),
        row(
            keys.link_acknowledgement(agent), "publication", "LinkAcknowledgement", "agent",
            "plant, which publishes it on the client's key",
            "wall-clock: one for every LinkRequest, in their order",
            by_agent, by_plant,
        ),
        row(
            keys.leave(agent), "publication", "Leave", "agent", "plant",
            "wall-clock: when it leaves properly; the plant then takes its inverter off the network",
            by_agent, by_plant,
        ),
        row(
            keys.status(agent), "publication", "AgentStatus", "agent", "plant, watchers",
            "wall-clock: every 0.5 s of wall time, and when its phase or its neighbours in use change",
            by_agent, people,
        ),
        row(
            keys.config(agent), "queryable", "-", "plant", "an agent of a live run",
            "wall-clock: asked once the plant's token is there; its AgentConfig as JSON",
            by_plant, ROLES,
        ),
        row(
            keys.feeder_map, "queryable", "-", "plant", "a client that draws the feeder",
            "wall-clock: asked once the plant's token is there; buses, branches, switches, inverters as JSON",
            by_plant, people,
        ),
        row(
            keys.command, "publication", "Command", "command line", "plant",
            "wall-clock: once the plant's token is there, to change something",
            ("operator",), by_plant,
        ),
        row(
            keys.request, "publication", "Command", "command line, recorder", "plant",
            "wall-clock: once the plant's token is there, to learn something (status, links, telemetry); "
            "simulated: by the recorder, after each Telemetry and every second",
            ROLES, by_plant,
        ),
        row(
            keys.answer("ASKER"), "publication", "Answer, LinkAcknowledgement", "plant", "the command line that asked",
            "wall-clock: one Answer for every command; to a link command every LinkAcknowledgement, too; "
            "simulated: to a recorder that asks again",
            by_plant, ROLES,
        ),
    )  # fmt: skip
