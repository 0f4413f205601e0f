"""A command to the emulated links of a live run: as it travels, its errors, and faults in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import msgspec

from gridpeers.netem.fault_schedule import Change, Heal
from gridpeers.netem.models.delay import Constant, Uniform
from gridpeers.netem.models.loss import Bernoulli
from gridpeers.netem.models.medium import Cut, Rate
from gridpeers.netem.schema.fault import LONGEST_RUN, PROFILES, Fault
from gridpeers.netem.schema.pattern import Link, objections
from gridpeers.wire.plugins.plugin import Plugin
from gridpeers.wire.schema.plausible import Plausible
from gridpeers.wire.schema.table_schema import Problem
from gridpeers.wire.wording import first_of, printable


def words(kind: str, model: Any) -> str:
    """Return a fault in words: plain if it has one or two numbers, else the profile that has it, or its keys.

    The kind is one of `gridpeers.netem.schema.fault.KINDS`, or "partition"; the model a struct of
    `gridpeers.netem.models`.
    """
    match model:
        case Plugin(parameters=parameters):
            keys = [f"{name} {_shown(value)}" for name, value in parameters]
            return f"{kind} ({', '.join(keys)})" if keys else kind
        case Cut(hold=hold):
            return f"{kind}, messages kept" if hold else kind
        case Constant(delay_s=delay, fifo=False):
            return f"{kind} {delay:g} s"
        case Uniform(low_s=low, high_s=high, fifo=False, correlation=0.0):
            return f"{kind} {low:g} to {high:g} s"
        case Bernoulli(p=p):
            return f"{kind} {p:g}"
        case Rate(bytes_per_s=rate):
            return f"{kind} {rate:g} bytes/s"
    for name, profile in PROFILES.items():
        if getattr(profile, kind, None) == model:
            return f"{kind} of {name}"
    fields = msgspec.structs.fields(model)
    given = [(field.name, getattr(model, field.name), field.default) for field in fields]
    keys = [f"{name} {_shown(value)}" for name, value, default in given if value != default]
    if fields[0].name == "p" and len(keys) == 1:
        return f"{kind} {keys[0].removeprefix('p ')}"
    model_name = model.__struct_config__.tag
    return f"{kind} {model_name} ({', '.join(keys)})" if model_name else f"{kind} ({', '.join(keys)})"


def _shown(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:g}" if isinstance(value, float) else str(value) if not isinstance(value, tuple) else "..."


EVERYTHING = "{*, plant} <-> {*, plant}"
"""Pattern of all links there are."""


class LinkCommand(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True):
    """Either a fault or its end. The time from which it holds is sent beside it; times in it do not count."""

    fault: Fault | None = None
    """The fault that links get."""
    heal: Heal | None = None
    """The links whose faults end."""
    for_s: float | None = None
    """Duration of the fault (s of run time); without it, it holds until it is healed."""

    @property
    def on(self) -> str:
        """Pattern of the links."""
        return self._change.on

    @property
    def _change(self) -> Change:
        change = self.fault or self.heal
        if change is None or (self.fault and self.heal):
            raise ValueError("a command to links is either a fault or a heal")
        return change

    def at(self, t: float) -> Change:
        """Return the change of links if it holds from t (s of run time) on."""
        to_s = None if self.for_s is None else round(t + self.for_s, 9)
        times = {"from_s": t, "to_s": to_s} if self.fault else {"from_s": t}
        return msgspec.structs.replace(self._change, **times)

    def problems(self, microgrids: Mapping[str, str]) -> list[Problem]:
        """Return all its errors in a run of these inverters."""
        links = [Problem("on", text) for text in objections(self.on, tuple(microgrids), microgrids)]
        return links + self.wrong_values()

    def wrong_values(self) -> list[Problem]:
        """Return the errors of its values, which are errors in every run."""
        problems: list[Problem] = []
        if self.fault is not None:
            problems += msgspec.structs.replace(self.fault, from_s=0.0, to_s=None).problems()
        if self.for_s is not None:
            allowed = Plausible("a time of the run", 0.0, LONGEST_RUN, above_zero=True)
            if text := allowed.objection(self.for_s, "s"):
                problems.append(Problem("for", text))
        return problems

    def __str__(self) -> str:
        """Return it in words."""
        where = "all links" if self.on == EVERYTHING else self.on
        if self.fault is None:
            return f"{where}: heal"
        faults = [words(kind, model) for kind, model in self.fault.models().items()]
        return f"{where}: " + ", ".join(faults + ([] if self.for_s is None else [f"for {self.for_s:g} s"]))

    def in_words(self, impaired: Sequence[Link]) -> str:
        """Return it in words, given which of its links have a fault when it begins to hold."""
        if self.fault is not None:
            return str(self)
        if not impaired:
            return f"{'all links' if self.on == EVERYTHING else self.on}: no link has a fault, nothing to heal"
        return f"{_listed(impaired)}: healed"

    def to_tree(self) -> dict[str, Any]:
        """Return it as it travels in a message."""
        tree: dict[str, Any] = msgspec.to_builtins(self)
        return tree

    @classmethod
    def of_tree(cls, tree: Mapping[str, Any]) -> LinkCommand:
        """Return the command in a message; raise ValueError if it is none."""
        try:
            command = msgspec.convert(tree, type=cls)
        except msgspec.ValidationError as error:
            raise ValueError(f"no command to links: {printable(str(error), 200)}") from None
        if command.fault is not None and command.fault.own:  # else anybody who reaches the run could import any module
            raise ValueError("no command to links: a fault of your own is written in the scenario before the run")
        command.on  # noqa: B018  checks that it is one of the two
        return command


MOST_NAMED = 8
"""Links that are named at most; a partition of nine inverters affects 36."""


def _listed(links: Sequence[Link]) -> str:
    """Return links in words; those that have a fault both ways as one."""
    both = {link for link in links if Link(link.dst, link.src) in links}
    first = [link for link in links if link not in both or links.index(link) < links.index(Link(link.dst, link.src))]
    named = [f"{link.src} {'<->' if link in both else '->'} {link.dst}" for link in first]
    return first_of(named, MOST_NAMED)
