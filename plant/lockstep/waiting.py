"""What the plant waits for in simulated time, phase by phase, and how long. Pure.

*gathering*: until every agent of the configuration has a token and a nameplate, and every recorder a token.
*preparing*: `Prepare` with the roster is out, until every agent on it is `Ready`.
*ticking*: Measurement(k) is out, until the whole roster has sent State(k). A change of the roster goes through
*preparing* again, between two ticks.
*joining*: the tick is held until those whom the scenario lets join have a token and a nameplate; telemetry has told,
once, that they are awaited. As the tick is held, it shows nowhere how long a process took to come up.
*closing*: `Stop` is out, until all tokens are gone, as proof that everybody has heard it.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Literal

from plant.lockstep.roster import Roster
from wire.codec import RejectedError
from wire.messages import PLANT, Ready, State
from wire.patience import Awaited, Patience

Phase = Literal["gathering", "preparing", "ticking", "joining", "closing", "over"]


class Waiting:
    """The present wait of the plant. Times are s on the driver's clock.

    Parameters
    ----------
    agents, recorders : tuple[str, ...]
        Who must be there before the run begins.
    roster : Roster
        Who takes part.
    deadline : float
        Longest wait without progress (s).

    Examples
    --------
    >>> from plant.config import PlantConfig, PlantSettings
    >>> from plant.schedule import Schedule
    >>> config = PlantConfig(run="demo", settings=PlantSettings(), agents=("inv1",), T_c=0.02, end=5.0,
    ...     record_step=0.01, deadline=10.0, listen=())
    >>> waiting = Waiting(config.agents, (), Roster(config.agents, ("inv1",), Schedule(config, ("inv1",))), 10.0)
    >>> waiting.missing(recorders=())
    (Awaited(what='token', who='inv1'),)
    >>> waiting.for_states(7, ("inv1",), now=0.0)
    >>> waiting.missing(recorders=()), waiting.until
    ((Awaited(what='State(7)', who='inv1'),), 10.0)
    >>> waiting.state(State(sender="inv1", incarnation=1, seq=7, t=0.14, P_set=5e4, V_set=277.0, Q=0.0), tick=7)
    >>> waiting.for_messages
    False
    """

    def __init__(self, agents: tuple[str, ...], recorders: tuple[str, ...], roster: Roster, deadline: float) -> None:
        self.phase: Phase = "gathering"
        self._agents, self._recorders, self._roster = agents, recorders, roster
        self._patience = Patience(PLANT, deadline)
        self.heard = self._patience.heard
        """Note a sign of life."""
        self._names: tuple[str, ...] = ()
        self._silent: set[str] = set()
        """Those of these who have not answered yet."""
        self._what = ""
        """Their answer, e.g. "State(41)"."""

    @property
    def until(self) -> float | None:
        """When the deadline passes; None if nothing is awaited."""
        return self._patience.until

    @property
    def begun(self) -> bool:
        """Whether everybody has been ready for the first roster."""
        return self.phase != "gathering" and not (self.phase == "preparing" and self._roster.number == 0)

    @property
    def for_messages(self) -> bool:
        """Whether somebody on the roster has not answered yet."""
        return bool(self._silent)

    @property
    def wanted(self) -> int:
        """Number of messages that are missing; at least one."""
        return max(1, len(self._silent))

    def for_tokens(self, now: float) -> None:
        """Wait for who must be there at the start."""
        self._patience.renew(now)

    def for_joiners(self, now: float) -> None:
        """Wait for whom the roster lets join."""
        self.phase = "joining"
        self._patience.renew(now)

    def for_ready(self, number: int, names: tuple[str, ...], now: float) -> None:
        """Wait until everybody is ready for a roster."""
        self._for_all("preparing", f"Ready({number})", names, now)

    def for_states(self, tick: int, names: tuple[str, ...], now: float) -> None:
        """Wait for everybody's state of a tick."""
        self._for_all("ticking", f"State({tick})", names, now)

    def _for_all(self, phase: Phase, what: str, names: tuple[str, ...], now: float) -> None:
        self.phase, self._what, self._names, self._silent = phase, what, names, set(names)
        self._patience.renew(now)

    def to_close(self, until: float) -> None:
        """Wait for the others to close."""
        self.phase, self._silent = "closing", set()
        self._patience.until = until

    def be_over(self) -> None:
        """Wait no more."""
        self.phase = "over"
        self._patience.rest()

    def ready(self, message: Ready) -> None:
        """Take word that somebody is ready.

        Raises
        ------
        RejectedError
            If this is not awaited.
        """
        if self.phase != "preparing" or message.seq != self._roster.number:
            raise RejectedError("stale", f"Ready({message.seq}) of {message.sender} in phase {self.phase}")
        self._silent.discard(message.sender)

    def state(self, message: State, tick: int) -> None:
        """Take somebody's state, while the plant stands at a tick.

        Raises
        ------
        RejectedError
            If this is not awaited.
        """
        if self.phase != "ticking" or message.seq != tick or message.sender not in self._silent:
            kind = "stale" if message.seq <= tick else "unexpected"
            raise RejectedError(kind, f"State({message.seq}) of {message.sender} at tick {tick} ({self.phase})")
        self._silent.discard(message.sender)

    def lost(self, name: str) -> None:
        """Note that somebody is gone, and will not answer."""
        self._silent.discard(name)

    def missing(self, recorders: Collection[str]) -> tuple[Awaited, ...]:
        """Who is awaited, and for what, when these recorders are there."""
        match self.phase:
            case "gathering":
                absent = [Awaited("token", name) for name in self._recorders if name not in recorders]
                return (*self._roster.absent(self._agents), *absent)
            case "joining":
                return self._roster.absent(self._roster.joining)
            case "preparing" | "ticking":
                return tuple(Awaited(self._what, name) for name in self._names if name in self._silent)
        return ()

    def complaint(self, missing: tuple[Awaited, ...], now: float) -> str:
        """What to say of these once the deadline has passed."""
        return self._patience.complaint(missing, now)
