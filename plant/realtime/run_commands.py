"""Commands that people give to a running plant and to its emulated links, and the answers. Pure."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import islice
from typing import TYPE_CHECKING, Any

import msgspec

from gridpeers.plant.plant_interface import LivePlant
from gridpeers.wire.codec import RejectedError, encode
from gridpeers.wire.keys import READING
from gridpeers.wire.links import Links
from gridpeers.wire.messages import PLANT, Answer, Command, LinkAcknowledgement, LinkRequest
from gridpeers.wire.post import ANYBODY, Post, Route
from gridpeers.wire.timing import RateLimit, time_of
from gridpeers.wire.wording import printable

if TYPE_CHECKING:
    from gridpeers.plant.plant_node import PlantNode
    from gridpeers.plant.realtime.realtime import RealtimeTimer

AGAIN = 1.0  # time (s, real time) after which a command that was not acknowledged is sent again

COMMANDS, COMMAND_INTERVAL = 100, 0.02
"""Commands of one verb that are carried out at once, and time (s) until one more: a flood of commands must not delay a
step."""

NOTED = ("open", "close", "synchronise", "load", "stop")
"""Verbs that change a run: each command is an event of it. Those to links are events of kind "command" too."""

MOST_SWITCHES, MOST_LOADS = 500, 150  # most of them in a status, which must fit into an answer


class LinkCommandSender:
    """`report`: publishes for recorders."""

    def __init__(self, post: Post, links: Links | None, report: Callable[[bytes], None]) -> None:
        self._post, self._keys = post, post.keys
        self._links, self._report = links, report
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
        self._report(encode(request))
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
                self._post.send(self._keys.link_request(name), request)

    def ask(self, names: Iterable[str], t: float, reply_to: str) -> None:
        """Have these agents report the status of the links to them at t (s of run time), and report the plant's own."""
        question = self._request(0, {}, t, reply_to)
        for name in names:
            self._post.send(self._keys.link_request(name), question)
        own, epoch = self.links.status(t), self._post.epoch
        self._pass_on(
            LinkAcknowledgement(sender=PLANT, epoch=epoch, seq=0, t=t, ok=True, text="", reply_to=reply_to, data=own)
        )

    def on_answer(self, answer: LinkAcknowledgement, payload: bytes, now: float) -> None:
        """Note the answer of an agent, and pass it on to the client that gave the command."""
        name = answer.sender
        self._acknowledged[name] = max(self._acknowledged.get(name, 0), min(answer.seq, len(self._given)))
        self._pass_on(answer)

    def forget(self, name: str) -> None:
        """Note that an agent is gone: the next agent of its name is sent all commands."""
        self._acknowledged.pop(name, None)
        self._sent.pop(name, None)

    def _request(self, number: int, tree: dict[str, Any], t: float, reply_to: str) -> LinkRequest:
        return LinkRequest(sender=PLANT, epoch=self._post.epoch, seq=number, t=t, link_command=tree, reply_to=reply_to)

    def _pass_on(self, answer: LinkAcknowledgement) -> None:
        self._post.send(self._keys.answer(answer.reply_to), answer)


class RunCommands:
    """Takes the commands on the keys of a plant node, and calls what it offers."""

    def __init__(
        self, node: PlantNode, plant: LivePlant, timer: RealtimeTimer, link_commands: LinkCommandSender
    ) -> None:
        self._node, self._plant, self._timer, self._link_commands = node, plant, timer, link_commands
        self._limit = RateLimit(burst=COMMANDS, interval=COMMAND_INTERVAL)
        node.routes[node.keys.command] = Route(ANYBODY, (Command,), self._on_command)
        node.routes[node.keys.request] = Route(ANYBODY, (Command,), self._on_request)

    def _on_request(self, command: Command, payload: bytes, now: float) -> None:
        if command.verb not in READING:
            raise RejectedError("unexpected", f'"{command.verb}" on the key of read-only users')
        self._on_command(command, payload, now)

    def _on_command(self, command: Command, payload: bytes, now: float) -> None:
        if self._limit.admit(command.verb, now) is None:
            raise RejectedError("excess", f'more than {COMMANDS} commands "{command.verb}" at once')
        answer = self._carry_out(command, now)
        self._node.post.send(self._node.keys.answer(command.reply_to), answer)
        if answer.ok:
            self._follow_up(command, now)
        if command.verb == "telemetry" and self._node.phase != "running":
            self._node.feed.replay()

    def _carry_out(self, command: Command, now: float) -> Answer:
        """Carry a command out, as far as that goes before its answer; return the answer."""
        node, t = self._node, self._node.stepper.t
        data = dict[str, Any]()
        try:
            if node.phase not in ("gathering", "running") and command.verb != "telemetry":
                raise ValueError("the run is ending")
            if command.verb == "status":
                text, data = f"run {node.config.run} is {node.phase} at t = {t:.2f} s", self._status()
            elif command.verb in ("link", "links"):
                text, data = self._command_links(command, now)
            else:
                text = self._say(command)
                if command.verb in NOTED:
                    node.stepper.note("command", command.argument, text)
            ok = True
        except ValueError as error:
            text, ok = str(error), False
        epoch = node.config.epoch
        return Answer(sender=PLANT, epoch=epoch, seq=command.seq, t=t, ok=ok, text=printable(text), data=data)

    def _follow_up(self, command: Command, now: float) -> None:
        agents = self._node.members.nameplates
        if command.verb == "link":
            self._link_commands.send(agents, now)
        elif command.verb == "links":
            self._link_commands.ask(agents, self._node.stepper.t, command.reply_to)
        elif command.verb == "down":
            self._node.close("the run was ended by command", now)

    def _say(self, command: Command) -> str:
        """Carry out a command whose answer is a sentence alone."""
        node, plant = self._node, self._plant
        verb, argument = command.verb, command.argument
        if verb == "telemetry":
            if not (argument.isascii() and argument.isdigit() and len(argument) < 16):
                raise ValueError(f'telemetry: "{argument[:20]}" is no number of a Telemetry; give one, e.g. 0')
            return str(node.feed.again_from(int(argument)))
        when = f"at t = {node.stepper.t:.2f} s"
        if verb == "down":
            return f"run {node.config.run} ends {when}"
        if verb == "stop":
            instance = node.members.instance(argument)
            if not instance:
                running = ", ".join(name for name in plant.inverters if node.members.instance(name)) or "none"
                raise ValueError(f'no agent "{argument}" is running; running are: {running}')
            node.meeting.stop(node.keys.stop_request(argument, instance), "stopped by command")
            return f"{argument} was asked to leave {when}"
        if verb == "load":
            if command.load is None:
                raise ValueError(f"load {argument}: nothing to set; give a factor, or real or reactive power")
            return f"{plant.set_load(argument, command.load)}, {when}"
        if verb == "synchronise":
            plant.switch(argument, "close", synchronised=True)
            return f"switch {argument}: close in step {when}"
        if plant.switch(argument, verb):
            return f"switch {argument} was {'open' if verb == 'open' else 'closed'} already {when}"
        return f"switch {argument}: {verb} {when}"

    def _command_links(self, command: Command, now: float) -> tuple[str, dict[str, Any]]:
        """Return the command's effect in words; its number, its start (s), and the agents that are sent it.

        It holds from one control period after the due tick on: by then all agents have it.
        """
        agents = self._agents(present=True)
        stepper, pacer = self._node.stepper, self._timer.pacer
        if command.verb == "links":
            assert self._link_commands.links is not None  # a run without any is an error
            return "the links are asked for their status", {"number": 0, "t": stepper.t, "asked": agents}
        overdue = max(0, int((now - pacer.due) / pacer.period))
        runs = self._node.phase == "running"
        t = time_of(stepper.tick + 1 + overdue, stepper.config.T_c) if runs else stepper.t
        request, text, receivers = self._link_commands.give(command.link_command, t, command.reply_to)
        start = f", from t = {t:.2f} s on" if receivers else ""
        stepper.note("command", "links", f"link command {request.seq}: {text}{start}")
        return text, {"number": request.seq, "t": request.t, "asked": agents, "receivers": receivers}

    def _agents(self, *, present: bool) -> list[str]:
        met = self._node.members.nameplates
        return [name for name in self._plant.inverters if (name in met) == present]

    def _status(self) -> dict[str, Any]:
        """Return the run's status: times in s, delays in s of real time."""
        node, stepper, plant = self._node, self._node.stepper, self._plant
        return {
            "run": node.config.run,
            "phase": node.phase,
            "t": stepper.t,
            "tick": stepper.tick,
            "end": node.config.end,
            "speed": node.config.speed,
            "pacing": msgspec.to_builtins(self._timer.pacing()),
            "agents": self._agents(present=True),
            "absent": self._agents(present=False),
            "events": msgspec.to_builtins(tuple(stepper.latest)),
            "switches": dict(islice(plant.switches.items(), MOST_SWITCHES)),
            "loads": {name: [S.real, S.imag] for name, S in islice(plant.loads.items(), MOST_LOADS)},
            "impaired": list(node.reports.impaired()),
            "rejected": sum(node.rejects.counts.values()),
        }
