"""Agents and recorders by their tokens; processes that cannot take part; scheduled moves of agents. Pure."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from math import inf

from gridpeers.plant.plant_config import PlantConfig, ScheduledAction
from gridpeers.plant.plant_stepper import PlantStepper
from gridpeers.plant.recorder_feed import RecorderFeed
from gridpeers.wire.messages import PLANT, Stop
from gridpeers.wire.phases import Phases
from gridpeers.wire.post import Post
from gridpeers.wire.timing import Awaited, RateLimit
from gridpeers.wire.wording import printable

STAYS = "its inverter stays on primary droop at its last set-points"  # state of the inverter whose agent has died
AGAIN = 1.0  # time (s) after which a question without an answer is asked again
MOST_RECORDERS = 20  # recorders that are noted beside those that the run waits for: anybody may hold tokens

REFUSALS, REFUSAL_INTERVAL = 20, 0.1
"""Refusals that are logged and answered at once, and time (s) until one more: each needs its own publisher, which holds
up a plant in real time for a millisecond or two."""


def agent_schedule(config: PlantConfig, inverters: tuple[str, ...]) -> dict[int, list[ScheduledAction]]:
    """Return the scheduled joins, leaves and deaths of a run, by tick.

    ValueError if an action names no inverter of the plant, or its time is no tick after 0.
    """
    at: dict[int, list[ScheduledAction]] = {}
    for action in config.schedule:
        if action.inverter not in inverters:
            raise ValueError(f'schedule: no inverter "{action.inverter}"; inverters are {", ".join(inverters)}')
        tick = round(action.t / config.T_c)
        if tick < 1 or abs(tick * config.T_c - action.t) > 1e-9 * max(1.0, action.t):
            raise ValueError(
                f"schedule: {action.inverter} must {action.action} at a positive multiple of the control period "
                f"{config.T_c:g} s, got {action.t:g} s"
            )
        at.setdefault(tick, []).append(action)
    return at


class Meeting:
    def __init__(self, post: Post, stepper: PlantStepper, phases: Phases, feed: RecorderFeed) -> None:
        self.post, self.stepper, self.phases, self.feed = post, stepper, phases, feed
        self.recorders: set[str] = set()  # those present; in real time also those lost while the run went on
        self._live = stepper.config.clock == "realtime"
        self._needed = stepper.config.recorders
        self._tokens: set[str] = set()
        """Tokens of agents and recorders that take part; while the run ends, also of agents that were told to stop."""
        self._refusal_limit = RateLimit(REFUSALS, REFUSAL_INTERVAL)
        self._log_limit = RateLimit(burst=1, interval=inf)

    @property
    def has_agents(self) -> bool:
        return any(self.post.keys.parts(token)[1] == "agent" for token in self._tokens)

    @property
    def is_alone(self) -> bool:
        """Whether all have gone, but for recorders that the run waits for."""
        return self._tokens <= {self.post.keys.alive_recorder(name) for name in self._needed}

    def missing(self, names: Iterable[str], recorders: bool = False) -> tuple[Awaited, ...]:
        """Return the tokens and nameplates that are missing of agents, and perhaps of the recorders of the run."""
        members = self.post.members
        names = tuple(names)
        here = {name for name in names if members.instance(name)}
        absent = [name for name in self._needed if recorders and name not in self.recorders]
        return (
            *(Awaited("token", name) for name in names if name not in here),
            *(Awaited("nameplate", name) for name in names if name in here and name not in members.nameplates),
            *(Awaited("token", name) for name in absent),
        )

    def appeared(self, key: str, now: float, refusal: Callable[[str, str], str]) -> None:
        """Note a token, unless its process is refused.

        `refusal`: returns why the process of an agent cannot take part now, an empty string if it can.
        """
        match self.post.token(key, now, appeared=True):
            case ("alive", "recorder", name):
                self._recorder_came(key, name)
            case ("alive", "agent", name, instance):
                self._agent_came(key, name, instance, refusal(name, instance), now)

    def vanished(self, key: str, now: float) -> str:
        """Note that a token is gone; return the agent whose process it was, if that took part."""
        self._tokens.discard(key)
        match self.post.token(key, now, appeared=False):
            case ("alive", "recorder", name):
                if name in self._needed and self._live and self.phases.now == "running":
                    self.post.say(f"recorder {name} is out of reach; what it misses is kept for a while")
                else:
                    self.recorders.discard(name)
            case ("alive", "agent", name, instance) if self.post.process_gone(name, instance):
                return name
        return ""

    def stop(self, key: str, reason: str, *, refused: bool = False) -> None:
        """Ask the agents that listen to a key to stop."""
        tick, t = self.stepper.tick, self.stepper.t
        stop = Stop(sender=PLANT, epoch=self.post.epoch, seq=tick, t=t, reason=printable(reason), refused=refused)
        self.post.send(key, stop)

    def _recorder_came(self, key: str, name: str) -> None:
        if not (name in self.recorders or name in self._needed or len(self.recorders) < MOST_RECORDERS):
            text = f"the token of recorder {name}; {MOST_RECORDERS} others hold tokens"
            self.post.rejects.add("excess", key, text)
            return
        if name in self.recorders and key not in self._tokens:
            self.post.say(f"recorder {name} is back")
        self._tokens.add(key)
        self.recorders.add(name)

    def _agent_came(self, key: str, name: str, instance: str, reason: str, now: float) -> None:
        ends = not self.phases.allows("end")
        if not (ends or reason):
            if self.post.process_came(name, instance):
                self._tokens.add(key)
        elif self._refusal_limit.admit("refused", now) is None:
            text = f"a token of {name}, beyond the number of refusals that are answered"
            self.post.rejects.add("excess", key, text)
        elif ends:  # it has missed the `Stop` to all
            self._tokens.add(key)
            self.stop(self.post.keys.stop_request(name, instance), self.stepper.outcome or "the run has ended")
        else:
            if self._log_limit.admit(reason.partition(": ")[2], now) is not None:
                self.post.say(f"refused {reason}; further refusals of this kind go only to the agent itself")
            self.stop(self.post.keys.stop_request(name, instance), reason, refused=True)
