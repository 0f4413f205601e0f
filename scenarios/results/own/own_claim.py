"""Claims of one's own: from a function to a verdict.

    @gridpeers.claim("restored")
    def restored(found):
        '''Frequency and sharing are back within 1 s of islanding.'''
        t = found.results["IV"]["event1"].t_restore_s
        return t is not None and t <= 1.0, f"{t} s"

A claim is a function of what was found that returns whether it holds, and our value with its unit; or a
`gridpeers.Claim` object, which also says which cases, events and steady values it needs. What was found:
`found.results[case][event]` has the measures (f_error_Hz, MPSI, V_error, MQSI, t_restore_s, t_load_s), and
`found.own[case][event].values[name]` the scenario's own metrics (`docs/plugins.md`).
"""

from __future__ import annotations

import copy
import inspect
from collections.abc import Sequence
from typing import Any

import numpy as np

from scenarios.results.claims import Claim, Verdict, judge
from scenarios.results.findings import Findings
from scenarios.results.own.claim_registry import CLAIMS
from wire.plugin import Plugin, made
from wire.printable import printable
from wire.registry import PluginError


def claim_of(plugin: Plugin) -> Claim:
    """Return a claim; a function's sentence is the first line of its docstring.

    Raises
    ------
    PluginError
        If there is none, or it cannot be made with these parameters.
    """
    found = made(CLAIMS, plugin)
    if isinstance(found, Claim):
        return found
    kind = found if inspect.isroutine(found) else type(found)
    name = plugin.use.rpartition(":")[2]
    text = (inspect.getdoc(kind) or "").partition("\n")[0].rstrip(".") or name

    def holds(findings: Findings) -> tuple[bool, str]:
        result = found(findings)
        if isinstance(result, tuple) and len(result) == 2:
            return _truth(result[0]), printable(str(result[1]), 200)
        return _truth(result), ""

    return Claim(name=name, text=text, source=plugin.use, judge=holds, measures=())


def _truth(value: Any) -> bool:
    """Return whether a claim holds: a text, or a forgotten `return`, says nothing of it."""
    if not isinstance(value, bool | np.bool_):
        raise TypeError(f"returned {value!r:.60}; return True or False, or that and our value: (True, '0.3 s')")
    return bool(value)


def judged(found: Findings, plugins: Sequence[Plugin]) -> tuple[Verdict, ...]:
    """Return the verdicts on one's own claims; one that raises does not hold, and its verdict says why."""
    verdicts: list[Verdict] = []
    for plugin in plugins:
        try:
            claim = claim_of(plugin)
        except PluginError as error:
            claim = Claim(name=plugin.use, text=plugin.use, source="", judge=lambda _: (False, ""), measures=())
            verdicts.append(Verdict(claim=claim, status="FAIL", found=str(error)))
            continue
        verdicts += judge(copy.deepcopy(found), (claim,))  # what it changes there is no other claim's concern
    return tuple(verdicts)
