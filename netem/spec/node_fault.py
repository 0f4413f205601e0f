"""An entry `[[node]]`: what befalls one agent's process, clock or computer."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec

from netem.netem_errors import Mistake, amount, below, seconds
from netem.plausible_links import Range
from netem.spec.fault import wrong_times
from wire.suggestion import suggestion


class Skew(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """An agent's own clock: it shows factor * t + offset_s at run time t."""

    factor: float = 1.0
    """How fast it goes: 1.0001 gains 100 ppm, as a cheap crystal may."""
    offset_s: float = 0.0
    """By how much it is ahead at t = 0 (s); negative is behind."""

    def mistakes(self) -> list[Mistake]:
        """Values that cannot be meant."""
        ppm = f"; did you mean {1.0 + self.factor * 1e-6:.9g} ({self.factor:g} ppm)?" if self.factor > 2.0 else ""
        found = amount("factor", self.factor, Range("the rate of a clock", "", 0.5, 2.0), ppm)
        return found + amount("offset_s", self.offset_s, Range("the offset of a clock", "s", -3600.0, 3600.0))


class NodeFault(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True):
    """What befalls the agent of one inverter."""

    name: str
    """The inverter."""
    from_s: float = 0.0
    """From when (s of run time)."""
    to_s: float | None = None
    """Until when (s); without it, to the end of the run."""
    kill: bool = False
    """Whether its process ends at from_s, without a word and for good."""
    pause: bool = False
    """Whether its process stands still from from_s to to_s; what it is sent waits."""
    slow_s: float = 0.0
    """By how much longer it computes each tick (s), its state being sent that much later."""
    skew: Skew | None = None
    """How wrong its clock is."""

    def mistakes(self, names: Sequence[str] | None) -> list[Mistake]:
        """Values that cannot be meant; without names of agents any may be one."""
        found = wrong_times(self.from_s, self.to_s) + seconds("slow_s", self.slow_s, "a computing delay")
        if names is not None and self.name not in names:
            found.append(Mistake("name", f'no agent "{self.name}"; {suggestion(self.name, names, "agents")}'))
        if not (self.kill or self.pause or self.slow_s or self.skew):
            found.append(Mistake("", "does nothing; give it kill, pause, slow_s or skew"))
        if self.kill and (self.pause or self.to_s is not None):
            found.append(Mistake("kill", "who is killed stays so; for a while, write pause = true with to_s"))
        elif self.pause and self.to_s is None:
            found.append(Mistake("pause", "a pause has an end; give to_s, or write kill = true"))
        return found + below("skew", self.skew.mistakes() if self.skew else [])
