"""Sound cases for the tests of checks, and copies with a planted fault."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import replace
from functools import cache, partial
from typing import Any

import numpy as np

import gridpeers as gp
from gridpeers.lab.communication.communication_checks import CommunicationSummary
from gridpeers.lab.communication.record_pass import RecordContent
from gridpeers.scenarios.checks.check_registry import chosen_checks
from gridpeers.scenarios.checks.check_verdict import CheckVerdict, judge_by
from gridpeers.scenarios.checks.checked_case import CheckedCase
from gridpeers.scenarios.results.history import History


@cache
def ran(name: str = "islanding", case: str = "IV") -> gp.Result:
    """A case of the catalogue, run once in this process."""
    return gp.load(name).run(case)


@cache
def ran_with(changes: tuple[tuple[str, Any], ...], case: str = "IV") -> gp.Result:
    """Islanding with other keys, run once; each change is a path and the `repr` of its value."""
    return gp.load("islanding").replace({path: eval(value) for path, value in changes}).run(case)


def changed(case: CheckedCase, edit: Callable[[dict[str, np.ndarray[Any, Any]]], None]) -> CheckedCase:
    """A case whose rows `edit` has changed: it gets copies of the arrays t, f, P, Q, V by name."""
    arrays = {name: getattr(case.history, name).copy() for name in ("t", "f", "P", "Q", "V", "P_set", "V_set")}
    edit(arrays)
    return replace(case, history=History(inverters=case.history.inverters, **arrays))


def altered(content: RecordContent, **parts: Any) -> RecordContent:
    other = copy(content)
    vars(other).update(parts)
    return other


def with_content(case: CheckedCase, content: RecordContent, *, late: float = 0.0) -> CheckedCase:
    """A case whose record has something else in it, in the order of time; of agents' journals, some time (s) late."""
    other = replace(case)
    sums = CommunicationSummary(content.info, content.t_end)
    sums.journal_ends = content.journal_ends
    of: dict[tuple[str, int, int], float] = {}
    entries: list[tuple[float, int, Callable[[], None]]] = []
    for agent, states in content.states.items():
        for key, state in states.items():
            of[agent, *key] = state.t
            entries.append((state.t, 1, partial(sums.take_state, agent, state)))
    for agent, decisions in content.decisions.items():
        for epoch, decision in decisions:
            t = (
                decision.tick * content.info.T_c
                if content.info.simulated
                else of.get((agent, epoch, decision.tick), 0.0)
            )
            entries.append((t + late, 0, partial(sums.take_decision, agent, epoch, decision)))
    for link, heard in content.heard.items():
        for (epoch, number), why in heard.items():
            entries.append((of[link[0], epoch, number] + late, 2, partial(sums.take_heard, link, epoch, number, why)))
    for traces in content.traces.values():
        entries += [(trace.t[-1] + late if trace.t else 0.0, 3, partial(sums.take_trace, trace)) for trace in traces]
    for _, _, take in sorted(entries, key=lambda entry: entry[:2]):
        take()
    sums.counts, sums.unreadable = content.counts, content.unreadable
    other.__dict__["communication"] = sums.finish()
    return other


def verdict(case: CheckedCase, check: str, **limits: Any) -> CheckVerdict:
    entries: Sequence[dict[str, Any]] = [{"use": check, **limits}]
    (found,) = judge_by({check: chosen_checks(entries)[check]}, case)
    return found
