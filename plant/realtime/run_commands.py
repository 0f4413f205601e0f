"""Commands that people give to a running plant and to its emulated links, and the answers. Pure."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import islice
from typing import TYPE_CHECKING, Any

import msgspec

from gridpeers.wire.codec import encode
from gridpeers.wire.keys import Keys
from gridpeers.wire.links import Links
from gridpeers.wire.messages import PLANT, Answer, Command, LinkAcknowledgement, LinkRequest
from gridpeers.wire.timing import time_of
from gridpeers.wire.wording import printable

if TYPE_CHECKING:
    from gridpeers.plant.realtime.realtime_plant import RealtimePlant

AGAIN = 1.0  # time (s, wall) after which a command that was not acknowledged is sent again


class LinkCommandSender:
    def __init__(self, epoch: int, keys: Keys, links: Links | None, publish: Callable[[str, bytes], None]) -> None:
        self._epoch, self._keys, self._links, self._publish = epoch, keys, links, publish
        self._given: list[LinkRequest] = []
        self._acknowledged: dict[str, int] = {}  # number of the last command that each agent has acknowledged
        self._sent: dict[str, tuple[int, float]] = {}  # number of the last command sent to each agent, and when (s)

    @property
    def links(self) -> Links:
        """The links to the plant; ValueError if the run has no emulated links."""
        if self._links is None:
            raise ValueError(
                "this run has no emulated links that could be changed; runs started by gridpeers plant or up have"
            )
        return self._links

    def give(self, tree: dict[str, Any], t: float, reply_to: str) -> tuple[LinkRequest, str, tuple[str, ...]]:
        """Have links carry out a person's command, for messages sent at t (s of run time) or later.

        It is in force for the plant's own links, and published for recorders; `send` sends it to the agents. Return the
        command, what it does in words, and the receivers of the links that it changes.

        ValueError if it is no command to links, or the run has no emulated links.
        """
        text, receivers, _ = self.links.command(tree, t)
        request = self._request(len(self._given) + 1, tree, t, reply_to)
        self._given.append(request)
        self._publish(self._keys.telemetry, encode(request))
        return request, text, receivers

    def send(self, names: Iterable[str], now: float) -> None:
        """Send to each agent the commands that are new, or that it has not acknowledged (s, driver's clock)."""
        last = len(self._given)
        for name in names:
            sent, at = self._sent.get(name, (0, now))
            acknowledged, again = self._acknowledged.get(name, 0), now - at >= AGAIN
            if acknowledged == last or (sent == last and not again):
                continue
            self._sent[name] = last, now
            for request in self._given[acknowledged if again else max(acknowledged, sent) :]:
                self._publish(self._keys.link_request(name), encode(request))

    def ask(self, names: Iterable[str], t: float, reply_to: str) -> None:
        """Have these agents report the status of the links to them at t (s of run time), and report the plant's own."""
        question = encode(self._request(0, {}, t, reply_to))
        for name in names:
            self._publish(self._keys.link_request(name), question)
        own, epoch = self.links.status(t), self._epoch
        self._pass_on(
            LinkAcknowledgement(sender=PLANT, epoch=epoch, seq=0, t=t, ok=True, text="", reply_to=reply_to, data=own)
        )

    def answered(self, answer: LinkAcknowledgement) -> None:
        """Note the answer of an agent, and pass it on to the client that gave the command."""
        name = answer.sender
        self._acknowledged[name] = max(self._acknowledged.get(name, 0), min(answer.seq, len(self._given)))
        self._pass_on(answer)

    def forget(self, name: str) -> None:
        """Note that an agent is gone: the next agent of its name is sent all commands."""
        self._acknowledged.pop(name, None)
        self._sent.pop(name, None)

    def impaired(self, t: float) -> tuple[str, ...]:
        """Return the agents whose link to or from the plant has a fault at t (s of run time)."""
        return () if self._links is None else self._links.impaired(t)

    def _request(self, number: int, tree: dict[str, Any], t: float, reply_to: str) -> LinkRequest:
        return LinkRequest(sender=PLANT, epoch=self._epoch, seq=number, t=t, link_command=tree, reply_to=reply_to)

    def _pass_on(self, answer: LinkAcknowledgement) -> None:
        self._publish(self._keys.answer(answer.reply_to), encode(answer))


MOST_SWITCHES, MOST_LOADS = 500, 150  # most of them in a status, which must fit into an answer


def answer(node: RealtimePlant, command: Command, now: float) -> Answer:
    """Carry a command out, as far as that goes before its answer; return the answer."""
    data = dict[str, Any]()
    try:
        if node.phase not in ("gathering", "running") and command.verb != "telemetry":
            raise ValueError("the run is ending")
        if command.verb == "status":
            text, data = f"run {node.config.run} is {node.phase} at t = {node.t:.2f} s", _status(node)
        elif command.verb in ("link", "links"):
            text, data = _command_links(node, command, now)
        else:
            text = _say(node, command)
        ok = True
    except ValueError as error:
        text, ok = str(error), False
    epoch, seq = node.config.epoch, command.seq
    return Answer(sender=PLANT, epoch=epoch, seq=seq, t=node.t, ok=ok, text=printable(text), data=data)


def follow_up(node: RealtimePlant, command: Command, now: float) -> None:
    agents = node.members.nameplates
    if command.verb == "link":
        node.link_commands.send(agents, now)
    elif command.verb == "links":
        node.link_commands.ask(agents, node.t, command.reply_to)
    elif command.verb == "down":
        node.close("the run was ended by command", now)


def _say(node: RealtimePlant, command: Command) -> str:
    """Carry out a command whose answer is a sentence alone."""
    verb, argument = command.verb, command.argument
    if verb == "telemetry":
        if not (argument.isascii() and argument.isdigit() and len(argument) < 16):
            raise ValueError(f'telemetry: "{argument[:20]}" is no number of a Telemetry; give one, e.g. 0')
        return str(node.recorder_feed.again_from(int(argument)))
    when = f"at t = {node.t:.2f} s"
    if verb == "down":
        return f"run {node.config.run} ends {when}"
    if verb == "stop":
        instance = node.members.instance(argument)
        if not instance:
            running = ", ".join(name for name in node.plant.inverters if node.members.instance(name)) or "none"
            raise ValueError(f'no agent "{argument}" is running; running are: {running}')
        node.stop(node.keys.stop_request(argument, instance), "stopped by command")
        return f"{argument} was asked to leave {when}"
    if verb == "load":
        if command.load is None:
            raise ValueError(f"load {argument}: nothing is to be set; give a factor, or real or reactive power")
        return f"{node.plant.set_load(argument, command.load)}, {when}"
    if verb == "synchronise":
        node.plant.switch(argument, "close", synchronised=True)
        return f"switch {argument}: close in step {when}"
    if node.plant.switch(argument, verb):
        return f"switch {argument} was {'open' if verb == 'open' else 'closed'} already {when}"
    return f"switch {argument}: {verb} {when}"


def _command_links(node: RealtimePlant, command: Command, now: float) -> tuple[str, dict[str, Any]]:
    """Return the command's effect in words; its number, its start (s), and the agents that are sent it.

    It holds from one control period after the due tick on: by then all agents have it.
    """
    agents = _agents(node, present=True)
    if command.verb == "links":
        assert node.link_commands.links is not None  # a run without any is an error
        return "the links are asked for their status", {"number": 0, "t": node.t, "asked": agents}
    overdue = max(0, int((now - node.pacer.due) / node.pacer.period))
    t = time_of(node.tick + 1 + overdue, node.config.T_c) if node.phase == "running" else node.t
    request, text, receivers = node.link_commands.give(command.link_command, t, command.reply_to)
    node.note_links(f"link command {request.seq}: {text}" + (f", from t = {t:.2f} s on" if receivers else ""))
    return text, {"number": request.seq, "t": request.t, "asked": agents, "receivers": receivers}


def _agents(node: RealtimePlant, *, present: bool) -> list[str]:
    met = node.members.nameplates
    return [name for name in node.plant.inverters if (name in met) == present]


def _status(node: RealtimePlant) -> dict[str, Any]:
    """Return the run's status: times in s, delays in s of wall time."""
    return {
        "run": node.config.run,
        "phase": node.phase,
        "t": node.t,
        "tick": node.tick,
        "end": node.config.end,
        "speed": node.config.speed,
        "pacing": msgspec.to_builtins(node.pacer.report()),
        "agents": _agents(node, present=True),
        "absent": _agents(node, present=False),
        "events": msgspec.to_builtins(node.events),
        "switches": dict(islice(node.plant.switches.items(), MOST_SWITCHES)),
        "loads": {name: [S.real, S.imag] for name, S in islice(node.plant.loads.items(), MOST_LOADS)},
        "impaired": list(node.link_commands.impaired(node.t)),
        "rejected": sum(node.rejects.counts.values()),
    }
