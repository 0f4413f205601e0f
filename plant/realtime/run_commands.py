"""Commands that people give to a running plant, and the answers. Pure."""

from __future__ import annotations

from itertools import islice
from typing import TYPE_CHECKING, Any

import msgspec

from gridpeers.wire.messages import PLANT, Answer, Command
from gridpeers.wire.timing import time_of
from gridpeers.wire.wording import printable

if TYPE_CHECKING:
    from gridpeers.plant.realtime.realtime_plant import RealtimePlant


MOST_SWITCHES = 500
"""Most switches in a status, which must fit into an answer."""

MOST_LOADS = 150
"""Most loads with another power than their table's in a status."""


class RunCommands:
    """Carry commands to a plant out."""

    def __init__(self, node: RealtimePlant) -> None:
        self._node = node

    def answer(self, command: Command, now: float) -> Answer:
        """Carry a command out, as far as that goes before its answer; return the answer."""
        node = self._node
        try:
            if node.phase not in ("gathering", "running") and command.verb != "telemetry":
                raise ValueError("the run is ending")
            text, data = self._do(command, now)
            ok = True
        except ValueError as error:
            text, data, ok = str(error), {}, False
        return Answer(
            sender=PLANT,
            epoch=node.config.epoch,
            seq=command.seq,
            t=node.t,
            ok=ok,
            text=printable(text),
            data=data,
        )

    def follow_up(self, command: Command, now: float) -> None:
        """Do the rest of a command once its answer is out."""
        node = self._node
        agents = node.members.nameplates
        if command.verb == "link":
            node.link_commands.send(agents, now)
        elif command.verb == "links":
            node.link_commands.ask(agents, node.t, command.reply_to)
        elif command.verb == "down":
            node.close("the run was ended by command", now)

    def _do(self, command: Command, now: float) -> tuple[str, dict[str, Any]]:
        """Carry a command out; return the text and the data of the answer."""
        verb = command.verb
        if verb == "status":
            status = self.status()
            return f"run {status['run']} is {status['phase']} at t = {status['t']:.2f} s", status
        if verb in ("link", "links"):
            return self._command_links(command, now)
        return self._say(command), {}

    def _say(self, command: Command) -> str:
        """Carry out a command whose answer is a sentence alone."""
        node, verb, argument = self._node, command.verb, command.argument
        if verb == "telemetry":
            if not (argument.isascii() and argument.isdigit() and len(argument) < 16):
                raise ValueError(f'telemetry: "{argument[:20]}" is no number of a Telemetry; give one, e.g. 0')
            return str(node.recorder_feed.kept.again_from(int(argument)))
        if verb == "down":
            return f"run {node.config.run} ends at t = {node.t:.2f} s"
        if verb == "stop":
            instance = node.members.instance(argument)
            if not instance:
                running = ", ".join(name for name in node.plant.inverters if node.members.instance(name)) or "none"
                raise ValueError(f'no agent "{argument}" is running; running are: {running}')
            node.stop(node.keys.stop_request(argument, instance), "stopped by command")
            return f"{argument} was asked to leave at t = {node.t:.2f} s"
        if verb == "load":
            if command.load is None:
                raise ValueError(f"load {argument}: nothing is to be set; give a factor, or real or reactive power")
            return f"{node.plant.set_load(argument, command.load)}, at t = {node.t:.2f} s"
        if verb == "synchronise":
            node.plant.switch(argument, "close", synchronised=True)
            return f"switch {argument}: close in step at t = {node.t:.2f} s"
        if node.plant.switch(argument, verb):
            return f"switch {argument} was {'open' if verb == 'open' else 'closed'} already at t = {node.t:.2f} s"
        return f"switch {argument}: {verb} at t = {node.t:.2f} s"

    def _command_links(self, command: Command, now: float) -> tuple[str, dict[str, Any]]:
        """Return the command's effect in words; its number, its start (s), and the agents that are sent it.

        It holds from one control period after the due tick on: by then all agents have it.
        """
        node = self._node
        agents = self._agents(present=True)
        if command.verb == "links":
            assert node.link_commands.links is not None  # a run without any is an error
            return "the links are asked for their status", {"number": 0, "t": node.t, "asked": agents}
        overdue = max(0, int((now - node.pacer.due) / node.pacer.period))
        t = time_of(node.tick + 1 + overdue, node.config.T_c) if node.phase == "running" else node.t
        request, text, receivers = node.link_commands.give(command.link_command, t, command.reply_to)
        node.note_links(f"link command {request.seq}: {text}" + (f", from t = {t:.2f} s on" if receivers else ""))
        return text, {"number": request.seq, "t": request.t, "asked": agents, "receivers": receivers}

    def _agents(self, *, present: bool) -> list[str]:
        met = self._node.members.nameplates
        return [name for name in self._node.plant.inverters if (name in met) == present]

    def status(self) -> dict[str, Any]:
        """Return the run's status: times in s, delays in s of wall time."""
        node = self._node
        return {
            "run": node.config.run,
            "phase": node.phase,
            "t": node.t,
            "tick": node.tick,
            "end": node.config.end,
            "speed": node.config.speed,
            "pacing": msgspec.to_builtins(node.pacer.report()),
            "agents": self._agents(present=True),
            "absent": self._agents(present=False),
            "events": msgspec.to_builtins(node.events),
            "switches": dict(islice(node.plant.switches.items(), MOST_SWITCHES)),
            "loads": {name: [S.real, S.imag] for name, S in islice(node.plant.loads.items(), MOST_LOADS)},
            "impaired": list(node.link_commands.impaired(node.t)),
            "rejected": sum(node.rejects.counts.values()),
        }
