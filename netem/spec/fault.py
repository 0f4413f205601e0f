"""An entry `[[link]]`: on which links, when, and what they do."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import msgspec

from netem.models.corrupt import Corrupt
from netem.models.cut import Cut
from netem.models.delay import AnyDelay, Constant
from netem.models.duplicate import Duplicate
from netem.models.flap import Flap
from netem.models.loss import AnyLoss, Bernoulli
from netem.models.own_fault import FAULTS
from netem.models.rate import Rate
from netem.models.slots import Slots
from netem.netem_errors import Mistake, below, seconds
from netem.spec.pattern import parse
from netem.spec.profiles import PROFILES
from wire.plugin import Plugin, problems
from wire.suggestion import suggestion

LONGEST_RUN = 86_400.0
"""A day (s): no schedule is longer."""

KINDS = ("cut", "flap", "loss", "rate", "slots", "delay", "duplicate", "corrupt")
"""What an entry may do to a link, in the order in which it is done."""

_SHORTHAND: dict[str, tuple[type, str]] = {
    "delay": (Constant, "delay_s"),
    "loss": (Bernoulli, "p"),
    "duplicate": (Duplicate, "p"),
    "corrupt": (Corrupt, "p"),
    "rate": (Rate, "bytes_per_s"),
}
"""What a bare number means."""


class Span(NamedTuple):
    """One fault on one link, for a time."""

    kind: str
    """One of `KINDS`, or "partition", which is a cut by another name; of somebody's own fault its name."""
    from_s: float
    """From when (s of run time), that instant included."""
    to_s: float
    """Until when (s), that instant not included; infinity is the whole run."""
    model: Any
    """The struct of `netem.models`, or the `Plugin` of somebody's own fault."""


class Fault(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True):
    """What some links do for a time. A message is judged by the entries that hold at the time it was sent."""

    on: str
    """Which links, e.g. "inv4 <-> inv7"; see `netem.spec.pattern`."""
    from_s: float = 0.0
    """From when (s of run time)."""
    to_s: float | None = None
    """Until when (s); without it, to the end of the run."""
    profile: str = ""
    """Name of a profile; keys given beside it take the place of the profile's."""
    delay: AnyDelay | float | None = None
    """Delay; a number is a constant one (s)."""
    loss: AnyLoss | float | None = None
    """Loss; a number is an independent probability."""
    duplicate: Duplicate | float | None = None
    """Duplicates; a number is their probability."""
    corrupt: Corrupt | float | None = None
    """Flipped bits; a number is their probability."""
    rate: Rate | float | None = None
    """Finite rate; a number is bytes per second."""
    slots: Slots | None = None
    """Time slots."""
    cut: Cut | bool | None = None
    """Whether the link is down."""
    flap: Flap | None = None
    """Up and down in turn."""
    own: tuple[Plugin, ...] = ()
    """Faults of your own, each under its name: "mine:Jammer" = { share = 0.2 } (`gridpeers doc faults`)."""

    @property
    def end(self) -> float:
        """Until when it holds (s), infinity if to the end of the run."""
        return math.inf if self.to_s is None else self.to_s

    def models(self) -> dict[str, Any]:
        """What the entry does, by kind, shorthands and profile resolved, in the order of `KINDS`; then its own faults.

        Examples
        --------
        >>> Fault(on="* <-> *", delay=0.1, loss=0.02).models()
        {'loss': Bernoulli(p=0.02), 'delay': Constant(fifo=False, delay_s=0.1)}
        """
        profile = PROFILES.get(self.profile)
        found: dict[str, Any] = {}
        for kind in KINDS:
            value = getattr(self, kind)
            if value is None:
                value = getattr(profile, kind, None)
            if kind == "cut" and isinstance(value, bool):
                value = Cut() if value else None
            elif isinstance(value, (int, float)):
                model, key = _SHORTHAND[kind]
                value = model(**{key: float(value)})
            if value is not None:
                found[kind] = value
        return found | {plugin.name: plugin for plugin in self.own}

    def spans(self, src: str, dst: str, microgrids: Mapping[str, str]) -> list[Span]:
        """What the entry does to one link."""
        if not parse(self.on).matches(src, dst, microgrids):
            return []
        return [Span(kind, self.from_s, self.end, model) for kind, model in self.models().items()]

    def mistakes(self) -> list[Mistake]:
        """Values that cannot be meant; `on` is judged where the names are known."""
        found = wrong_times(self.from_s, self.to_s)
        if self.profile and self.profile not in PROFILES:
            text = f'there is no profile "{self.profile}"; {suggestion(self.profile, PROFILES, "profiles")}'
            found.append(Mistake("profile", text))
        models = self.models()
        if not models and not found:
            text = "does nothing; give it one of profile, " + ", ".join(KINDS)
            found.append(Mistake("cut" if self.cut is False else "", text))
        for plugin in self.own:
            found += below(plugin.name, [Mistake(*wrong) for wrong in problems(FAULTS, plugin)])
        for kind, model in models.items():
            if isinstance(model, Plugin):
                continue
            wrong = model.mistakes()
            if isinstance(getattr(self, kind), (int, float)):  # the number has no key of its own
                wrong = [Mistake("", mistake.text) for mistake in wrong]
            found += below(kind, wrong)
        return found


def wrong_times(from_s: float, to_s: float | None) -> list[Mistake]:
    """Mistakes of an entry's times by themselves."""
    found = seconds("from_s", from_s, "a time of the run", high=LONGEST_RUN)
    if to_s is None:
        return found
    found += seconds("to_s", to_s, "a time of the run", high=LONGEST_RUN)
    if not found and to_s <= from_s:
        found.append(Mistake("to_s", f"{to_s:g} s is not after from_s = {from_s:g} s, so that the entry never holds"))
    return found
