"""Claims and their verdicts; a user's claim is a function.

    @gridpeers.claim("restored")
    def restored(findings):
        '''Frequency and sharing are back within 1 s of islanding.'''
        t = findings.results["IV"]["event1"].t_restore_s
        return t is not None and t <= 1.0, f"{t} s"

A claim is a function of what was found that returns whether it holds, and our value with its unit; or a
`gridpeers.Claim` object, which also says which cases, events and steady values it needs. What was found:
`findings.results[case][event]` has the measures (f_error_Hz, MPSI, V_error, MQSI, t_restore_s, t_load_s), and
`findings.own[case][event].values[name]` the scenario's own metrics (`docs/how-to/plug-ins.md`).
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from gridpeers.scenarios.results.metric import Measure, Quantity
from gridpeers.wire.plugins.plugin import Plugin, callable_objection, made, plugin_of
from gridpeers.wire.plugins.registry import ANYTHING, PluginError, Registry, named
from gridpeers.wire.wording import printable

if TYPE_CHECKING:
    from gridpeers.scenarios.results.findings import Findings


@dataclass(frozen=True, kw_only=True)
class Published:
    """One published number."""

    source: str
    """Place in the publication, e.g. "Table I"."""
    case: str
    event: str
    island: str = ""
    """First inverter of the island; empty for the whole microgrid."""
    quantity: Quantity
    paper: float
    """The number that the publication prints."""
    digits: int
    """Printed decimals."""
    limit: float | None = None
    """Largest difference that passes, in its unit; None without a tolerance."""

    @property
    def where(self) -> str:
        return f"case {self.case}, {self.event}" + (f", island of {self.island}" if self.island else "")

    def within(self, ours: float) -> bool | None:
        """Return whether our number is within the limit of the printed one; None without a limit."""
        return None if self.limit is None else abs(ours - self.paper) <= self.limit


CLAIMS: Registry[Any] = Registry(
    "claim", "claims", lambda it: "" if isinstance(it, Claim) else callable_objection(it, "findings")
)
"""Claims by name. Those of a publication come with its `Benchmark`."""


@dataclass(frozen=True, kw_only=True)
class Benchmark:
    """A publication's numbers and claims on one experiment, which the key `paper` of a scenario names.

    An entry point (group "gridpeers.benchmarks") or `module:Name` adds one.
    """

    numbers: tuple[Published, ...] = ()
    claims: tuple[Claim, ...] = ()
    summary: Callable[[Findings], Sequence[str]] = lambda _: ()
    """Function that returns a few lines on the distance to the publication, below the claims."""

    def lines(self, findings: Findings) -> list[str]:
        """Return the summary of a run; an exception becomes a line with the reason."""
        try:
            return [printable(str(line), 1000) for line in self.summary(findings)]
        except ANYTHING as error:  # a benchmark is a user's code
            return [f"The benchmark's summary failed: {named(error)}"]

    def number(self, case: str, event: str, quantity: str, island: str = "") -> Published | None:
        """Return the published number for a place in our results, or None."""
        place = (case, event, quantity, island)
        return next((one for one in self.numbers if (one.case, one.event, one.quantity, one.island) == place), None)


NO_BENCHMARK = Benchmark()  # The benchmark of a scenario that nobody has published


BENCHMARKS: Registry[Benchmark] = Registry(
    "benchmark", "benchmarks", lambda it: "" if isinstance(it, Benchmark) else "it is no gridpeers.Benchmark"
)


def benchmark_of(key: str | Mapping[str, Any]) -> Benchmark:
    """Return the benchmark that a scenario names in its key `paper`, PluginError without one; an empty one for ""."""
    plugin = plugin_of(key)
    return BENCHMARKS.resolve(plugin.use, plugin.folder) if plugin.use else NO_BENCHMARK


Status = Literal["PASS", "FAIL", "MISS", "NOT RUN"]
"""MISS: it does not hold, for a known reason that is shown; NOT RUN: a case that it is about was left out."""

Judge = Callable[["Findings"], tuple[bool, str]]  # Return whether a claim holds, and our value with its unit


@dataclass(frozen=True, kw_only=True)
class Claim:
    """One sentence that a run can confirm or refute."""

    name: str
    """Short name, for tests and files."""
    text: str
    source: str
    """Place in the publication."""
    judge: Judge
    measures: tuple[Measure, ...]
    """Measures that must be steady numbers for it to pass."""
    cases: tuple[str, ...] = ()
    """Cases that it needs."""
    events: tuple[str, ...] = ()
    """Events that it needs in these cases."""
    lacking: Callable[[Findings], str] = lambda _: ""
    """Function that returns a missing part of the run, e.g. an island, with which it fails; else an empty text."""
    figure: str = ""
    """Figure of the report that shows it; empty for a claim on a table."""
    known_miss: str = ""
    """Known reason why it cannot hold here: it is then a MISS, which does not fail the run."""


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """The verdict on one claim."""

    claim: Claim
    status: Status
    found: str
    """Our value, with its unit."""


def judge(findings: Findings, claims: Sequence[Claim]) -> tuple[Verdict, ...]:
    """Judge claims by the findings; an exception is a FAIL with its reason."""
    verdicts = []
    for claim in claims:
        try:
            status, found = _judgement(claim, findings)
        except ANYTHING as error:  # a claim is a user's code
            known = {*findings.results, *(event for of in findings.results.values() for event in of)}
            lacks = isinstance(error, KeyError) and known
            there = f"; cases and events are {', '.join(sorted(known))}" if lacks else ""
            said = str(error) if isinstance(error, PluginError) else f"cannot be judged: {named(error)}{there}"
            status, found = "FAIL", said
        verdicts.append(Verdict(claim=claim, status=status, found=found))
    return tuple(verdicts)


def _judgement(claim: Claim, findings: Findings) -> tuple[Status, str]:
    results = findings.results
    if missing := [case for case in claim.cases if case not in results]:
        return "NOT RUN", f"needs case {', '.join(missing)}"
    if absent := [event for event in claim.events if any(event not in results[case] for case in claim.cases)]:
        return "NOT RUN", f"needs {' and '.join(absent)}"
    if lacking := claim.lacking(findings):
        return "FAIL", lacking
    holds, value = claim.judge(findings)
    if not holds:
        return "MISS" if claim.known_miss else "FAIL", str(value)
    if unsteady := findings.unsteady(claim.cases, claim.events, claim.measures):
        more = f", and {len(unsteady) - 1} more" if len(unsteady) > 1 else ""
        return "FAIL", f"{value}, but {unsteady[0]}{more}"
    return "PASS", str(value)


def claim_of(plugin: Plugin) -> Claim:
    """Return a claim, which fails if it cannot be made; a function's sentence is the first line of its docstring."""
    try:
        claim = made(CLAIMS, plugin)
    except PluginError as error:
        kept = error

        def fail(findings: Findings) -> tuple[bool, str]:
            raise kept

        return Claim(name=plugin.use, text=plugin.use, source="", judge=fail, measures=())
    if isinstance(claim, Claim):
        return claim
    kind = claim if inspect.isroutine(claim) else type(claim)
    name = plugin.use.rpartition(":")[2]
    text = (inspect.getdoc(kind) or "").partition("\n")[0].rstrip(".") or name

    def holds(findings: Findings) -> tuple[bool, str]:
        import numpy as np  # which a scenario is read without

        result = claim(findings)
        truth, value = result if isinstance(result, tuple) and len(result) == 2 else (result, "")
        if not isinstance(truth, bool | np.bool_):  # a text, or a forgotten `return`, says nothing
            raise TypeError(f"returned {truth!r:.60}; return True or False, or that and our value: (True, '0.3 s')")
        return bool(truth), printable(str(value), 200)

    return Claim(name=name, text=text, source=plugin.use, judge=holds, measures=())
