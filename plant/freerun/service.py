"""What people ask of a running plant, and the answers. Wall-clock time only; pure."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import msgspec

from wire.bounds import LIMIT
from wire.messages import PLANT, Answer, Command
from wire.printable import printable

if TYPE_CHECKING:
    from plant.freerun import FreePlant


class Service:
    """Serves commands.

    Parameters
    ----------
    side : FreePlant
        The plant that is asked.
    """

    def __init__(self, side: FreePlant) -> None:
        self._side = side

    def serve(self, command: Command, now: float) -> Answer:
        """Do what is asked, but for "down", which is the plant's own; the answer says what became of it."""
        side = self._side
        try:
            if side.phase not in ("gathering", "running") and command.verb != "telemetry":
                raise ValueError("the run is ending")
            text = self._do(command, now)
            ok = True
        except ValueError as error:
            text, ok = str(error), False
        return Answer(
            sender=PLANT,
            incarnation=side.config.incarnation,
            seq=command.seq,
            t=side.t,
            ok=ok,
            text=printable(text, LIMIT),
        )

    def _do(self, command: Command, now: float) -> str:
        side, verb, argument = self._side, command.verb, command.argument
        if verb in ("link", "links"):
            return msgspec.json.encode(self._ordered(command, now)).decode()
        if verb == "status":
            return msgspec.json.encode(self.status()).decode()
        if verb == "telemetry":
            if not (argument.isascii() and argument.isdigit() and len(argument) < 16):
                raise ValueError(f'telemetry: "{argument[:20]}" is no number of a Telemetry; give one, e.g. 0')
            return str(side.kept.again_from(int(argument)))
        if verb == "down":
            return f"run {side.config.run} ends at t = {side.t:.2f} s"
        if verb == "stop":
            instance = side.instances.get(argument)
            if instance is None:
                running = ", ".join(name for name in side.plant.inverters if name in side.instances) or "none"
                raise ValueError(f'no agent "{argument}" is running; running are: {running}')
            side.stop(side.keys.dismissal(argument, instance), "stopped by command")
            return f"{argument} was asked to leave at t = {side.t:.2f} s"
        if verb == "synchronise":
            side.plant.switch(argument, "close", synchronised=True)
            return f"switch {argument}: close in step at t = {side.t:.2f} s"
        if side.plant.switch(argument, verb):
            return f"switch {argument} was {'open' if verb == 'open' else 'closed'} already at t = {side.t:.2f} s"
        return f"switch {argument}: {verb} at t = {side.t:.2f} s"

    def _ordered(self, command: Command, now: float) -> dict[str, Any]:
        """Number of an order, from when on it holds (s), what it does, and the agents that are there to be told."""
        side = self._side
        agents = [name for name in side.plant.inverters if name in side.plates]
        if command.verb == "link":
            order, said, receivers = side.order(command.argument, command.reply_to, now)
            return {"number": order.seq, "t": order.t, "asked": agents, "said": said, "receivers": receivers}
        side.ordering.check()
        return {"number": 0, "t": side.t, "asked": agents}

    def status(self) -> dict[str, Any]:
        """How the run stands: times in s, delays in s of wall time."""
        side = self._side
        return {
            "run": side.config.run,
            "phase": side.phase,
            "t": side.t,
            "tick": side.tick,
            "end": side.config.end,
            "speed": side.config.speed,
            "pacing": side.pacer.report(),
            "agents": [name for name in side.plant.inverters if name in side.plates],
            "absent": [name for name in side.plant.inverters if name not in side.plates],
            "events": list(side.events),
            "impaired": list(side.impaired),
            "rejected": sum(side.rejects.counts.values()),
        }
