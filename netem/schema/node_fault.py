"""An entry `[[node]]`: faults of one agent's process, clock or computer."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import msgspec

from netem.models.delay import LONGEST_DELAY
from netem.models.lie import AnyLie
from netem.schema.fault import EndTime, RunTime
from wire.schema.plausible import Plausible, Unit
from wire.schema.relations import problems_of
from wire.schema.suggestion import suggestion
from wire.schema.table_schema import Example, Problem


def _in_ppm(factor: float) -> str:
    return f"; did you mean {1.0 + factor * 1e-6:.9g} ({factor:g} ppm)?" if factor > 2.0 else ""


class Skew(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """An agent's own clock: it shows factor * t + offset_s at run time t."""

    factor: Annotated[float, Plausible("the rate of a clock", 0.5, 2.0, hint=_in_ppm)] = 1.0
    """How fast it goes: 1.0001 gains 100 ppm, as a cheap crystal may."""
    offset_s: Annotated[float, Unit("s"), Plausible("the offset of a clock", -3600.0, 3600.0)] = 0.0
    """By how much it is ahead at t = 0 (s); negative is behind."""


class NodeFault(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True):
    """Faults of the agent of one inverter."""

    name: Annotated[str, Example('"inv3"')]
    """The inverter."""
    from_s: RunTime = 0.0
    """From when (s of run time)."""
    to_s: EndTime = None
    """Until when (s); without it, to the end of the run."""
    kill: bool = False
    """Whether its process ends at from_s, without a word and for good."""
    pause: bool = False
    """Whether its process stands still from from_s to to_s; messages to it wait."""
    slow_s: Annotated[float, Unit("s"), Plausible("a computing delay", 0.0, LONGEST_DELAY)] = 0.0
    """By how much longer it computes each tick (s), its state being sent that much later."""
    skew: Skew | None = None
    """How wrong its clock is."""
    lies: AnyLie | None = None
    """What others hear in place of its states from from_s to to_s."""

    def problems(self, names: Sequence[str] | None) -> list[Problem]:
        """Return the problems of the values; without names of agents any name may be one."""
        found = problems_of(self)
        if names is not None and self.name not in names:
            found.append(Problem("name", f'no agent "{self.name}"; {suggestion(self.name, names, "agents")}'))
        if not (self.kill or self.pause or self.slow_s or self.skew or self.lies):
            found.append(Problem("", "does nothing; give it kill, pause, slow_s, skew or lies"))
        if self.lies is not None:
            found += self._wrong_lies(self.lies, names)
        if self.kill and (self.pause or self.to_s is not None):
            found.append(Problem("kill", "a killed agent stays so; for a while, write pause = true with to_s"))
        elif self.pause and self.to_s is None:
            found.append(Problem("pause", "a pause has an end; give to_s, or write kill = true"))
        return found

    def _wrong_lies(self, lie: AnyLie, names: Sequence[str] | None) -> list[Problem]:
        other, found = lie.in_name_of, []
        if other == self.name:
            found.append(Problem("lies.in_name_of", f"{other} needs no lie to speak in its own name; leave it out"))
        elif other and names is not None and other not in names:
            text = f'no agent "{other}"; {suggestion(other, names, "agents")}'
            found.append(Problem("lies.in_name_of", text))
        if self.kill or self.pause:
            found.append(Problem("lies", "an agent that is killed or paused says nothing; write an entry for each"))
        return found
