"""An entry `[[link]]`: the faults of some links for a time; and profiles of real links by name.

A profile is a starting point, not a measurement of a network: a number that is not from physics, a standard or a
published requirement is marked as assumed. Delays are one way, for messages of some 100 bytes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, NamedTuple

import msgspec

from gridpeers.netem.models.delay import AnyDelay, Constant, Lognormal, Normal, Uniform
from gridpeers.netem.models.loss import AnyLoss, Bernoulli, GilbertElliott
from gridpeers.netem.models.medium import Corrupt, Cut, Duplicate, Flap, Rate, Slots
from gridpeers.netem.models.own_fault import FAULTS
from gridpeers.netem.schema.pattern import parse
from gridpeers.wire.plugins.plugin import Plugin, plugin_of, plugin_problems, scalar_objection
from gridpeers.wire.schema.table_reading import shown
from gridpeers.wire.schema.table_schema import (
    After,
    Example,
    OtherKeys,
    Plausible,
    Problem,
    Shorthand,
    Unit,
    below,
    fields_of,
    problems_of,
)
from gridpeers.wire.wording import is_no_path, suggestion


class LinkProfile(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Faults of a kind of link."""

    title: str
    source: str
    """Where each number comes from."""
    delay: AnyDelay | None = None
    """Its delay."""
    loss: AnyLoss | None = None
    """Its loss."""
    rate: Rate | None = None
    """Its rate."""
    slots: Slots | None = None
    """Its slots."""


PROFILES: dict[str, LinkProfile] = {
    "fibre": LinkProfile(
        title="optical fibre within a town",
        source="5 us/km (refractive index 1.47) over 20 km are 0.1 ms; two switches, 0.1 ms, and loss 1e-6: assumed",
        delay=Constant(delay_s=0.0002),
        loss=Bernoulli(p=1e-6),
    ),
    "wifi-mesh": LinkProfile(
        title="Wi-Fi mesh of about three hops",
        source="assumed throughout: some ms a hop by contention, a tail by retries, short bursts of loss",
        delay=Lognormal(offset_s=0.001, median_s=0.006, sigma=0.7),
        loss=GilbertElliott(p=0.01, r=0.4),
    ),
    "lte": LinkProfile(
        title="LTE through a public network",
        source="assumed throughout: half of a round trip of 50 ms with a tail of schedulers and handovers, alike from "
        "one message to the next; losses are rare, as the radio link repeats",
        delay=Lognormal(offset_s=0.01, median_s=0.015, sigma=0.4, correlation=0.5),
        loss=GilbertElliott(p=0.0005, r=0.25),
    ),
    "plc": LinkProfile(
        title="narrow-band power-line carrier",
        source="rate of the order of those of PRIME and G3-PLC (ITU-T G.9904, G.9903: tens of kbit/s); slots, delay "
        "and bursts of loss (noise in step with the mains) assumed",
        delay=Uniform(low_s=0.005, high_s=0.02),
        loss=GilbertElliott(p=0.02, r=0.2),
        rate=Rate(bytes_per_s=4000.0, queue_bytes=2000),
        slots=Slots(period_s=0.1, length_s=0.05),
    ),
    "lora-like": LinkProfile(
        title="long-range radio of very low rate",
        source="684 bytes/s is 5470 bit/s, LoRa SF7 at 125 kHz (LoRaWAN Regional Parameters); queue, delay and loss "
        "assumed; the legal duty cycle of 1 % is not modelled",
        delay=Normal(mean_s=0.05, std_s=0.01),
        loss=Bernoulli(p=0.05),
        rate=Rate(bytes_per_s=684.0, queue_bytes=500),
    ),
    "geo-satellite": LinkProfile(
        title="geostationary satellite, one hop",
        source="up and down 35 786 km at the speed of light are 0.239 s, at the rim of the footprint (41 679 km) "
        "0.278 s; 260 ms is between them; jitter and loss assumed",
        delay=Normal(mean_s=0.26, std_s=0.01, fifo=True),
        loss=Bernoulli(p=0.001),
    ),
    "der-requirement": LinkProfile(
        title="the worst that distributed energy resources should have to bear",
        source="300 ms single trip and 1 % loss: the criteria for distributed PV of Zhang et al. (NREL), Energies 11 "
        "(2018), abstract; its rate of 9.6 kbit/s is left out, as it carries no 50 states a second",
        delay=Constant(delay_s=0.3),
        loss=Bernoulli(p=0.01),
    ),
}


LONGEST_RUN = 86_400.0  # A day (s): no schedule is longer

RunTime = Annotated[float, Unit("s"), Plausible("a time of the run", 0.0, LONGEST_RUN)]
EndTime = Annotated[float | None, Unit("s"), After("from_s"), Plausible("a time of the run", 0.0, LONGEST_RUN)]

KINDS = ("cut", "flap", "loss", "rate", "slots", "delay", "duplicate", "corrupt")
"""Kinds of faults of an entry, in the order in which a message meets them."""


class Span(NamedTuple):
    """One fault on one link, for a time."""

    kind: str
    """One of `KINDS`, or "partition", which is a cut by another name; of somebody's own fault its name."""
    from_s: float
    """From when (s of run time), that instant included."""
    to_s: float
    """Until when (s), that instant not included; infinity is the whole run."""
    model: Any
    """The struct of `gridpeers.netem.models`, or the `Plugin` of somebody's own fault."""


def _is_own(key: str) -> bool:
    return ":" in key or key in FAULTS.names


def _read_own(name: str, raw: Any, found: list[Problem]) -> tuple[Plugin, ...]:
    if raw is False:
        return ()
    table = {} if raw is True else raw
    if not isinstance(table, Mapping):
        text = f"must be true or a table of its parameters such as {{ p = 0.1 }}, got {shown(raw)}"
        found.append(Problem(name, text))
        return ()
    wrong = [Problem(f"{name}.{key}", text) for key, value in table.items() if (text := scalar_objection(value))]
    if not wrong and (not isinstance(table.get("folder", ""), str) or is_no_path(table.get("folder", ""))):
        wrong = [Problem(f"{name}.folder", f"must be the path of a folder, got {shown(table['folder'])}")]
    found += wrong
    return () if wrong else (plugin_of({**table, "use": name}),)


def _written_own(plugin: Plugin) -> tuple[str, dict[str, Any]]:
    return plugin.use, dict(plugin.parameters) | ({"folder": plugin.folder} if plugin.folder else {})


class Fault(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True):
    """Faults of some links for a time. The time at which a message was sent decides which entries apply to it."""

    on: Annotated[str, Example('"inv4 <-> inv7"')]
    """Links, e.g. "inv4 <-> inv7" (docs/reference/link-faults.md)."""
    from_s: RunTime = 0.0
    """Start (s of run time)."""
    to_s: EndTime = None
    """End (s); without it, the end of the run."""
    profile: str = ""
    """Name of a profile; keys beside it replace its keys."""
    delay: Annotated[AnyDelay | float | None, Shorthand(Constant, "delay_s")] = None
    """Delay; a number is a constant one (s)."""
    loss: Annotated[AnyLoss | float | None, Shorthand(Bernoulli, "p")] = None
    """Loss; a number is an independent probability."""
    duplicate: Annotated[Duplicate | float | None, Shorthand(Duplicate, "p")] = None
    """Duplicates; a number is their probability."""
    corrupt: Annotated[Corrupt | float | None, Shorthand(Corrupt, "p")] = None
    """Flipped bits; a number is their probability."""
    rate: Annotated[Rate | float | None, Shorthand(Rate, "bytes_per_s")] = None
    """Finite rate; a number is bytes per second."""
    slots: Slots | None = None
    """Time slots."""
    cut: Cut | bool | None = None
    """true: the link is down."""
    flap: Flap | None = None
    """Up and down in turn."""
    own: Annotated[tuple[Plugin, ...], OtherKeys(_is_own, _read_own, _written_own)] = ()
    """Faults of your own, each under its name: "mine:Jammer" = { share = 0.2 } (`gridpeers doc faults`)."""

    @property
    def end(self) -> float:
        """Until when it holds (s), infinity if to the end of the run."""
        return math.inf if self.to_s is None else self.to_s

    def models(self) -> dict[str, Any]:
        """Return the models of the entry by kind, shorthands and profile resolved, in the order of `KINDS`.

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
                value = _SHORTHANDS[kind].of(float(value))
            if value is not None:
                found[kind] = value
        return found | {plugin.use: plugin for plugin in self.own}

    def spans(self, src: str, dst: str, microgrids: Mapping[str, str]) -> list[Span]:
        if not parse(self.on).matches(src, dst, microgrids):
            return []
        return [Span(kind, self.from_s, self.end, model) for kind, model in self.models().items()]

    def problems(self) -> list[Problem]:
        """Return the problems of the values; those of `on` need the names, which `Netem` knows."""
        found = problems_of(self)
        if self.profile and self.profile not in PROFILES:
            text = f'there is no profile "{self.profile}"; {suggestion(self.profile, PROFILES, "profiles")}'
            found.append(Problem("profile", text))
        if not self.models() and not found:
            text = "does nothing; give it one of profile, " + ", ".join(KINDS)
            found.append(Problem("cut" if self.cut is False else "", text))
        for plugin in self.own:
            found += below(plugin.use, plugin_problems(FAULTS, plugin))
        return found


_SHORTHANDS = {field.name: field.mark(Shorthand) for field in fields_of(Fault)}
"""By kind: what a number alone stands for."""
