"""Checks: functions that judge every run, their registry, and the choice of a scenario.

    @gridpeers.check("nadir")
    def nadir(case):
        '''No grid-forming inverter falls below 59.3 Hz.'''
        f, forming = case.history.f, case.history.present & case.nameplates.GFM
        for row, column in zip(*(forming & (f < 59.3)).nonzero()):
            yield gridpeers.Violation(
                text="low frequency", t=case.history.t[row], agent=case.nameplates.names[column],
                value=f[row, column], unit="Hz", limit=59.3,
            )

Judge f and V only where `history.present` is true: an inverter that is off the network may have 0 Hz.

A check is a function of a recorded case that returns its violations, none for a run that passes; it raises
`gridpeers.NotJudgedError` where the record has no data for it. A class with parameters (annotated attributes,
`docs/how-to/plug-ins.md`), which are its limits, and a method `__call__(self, case)` is a check too.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from gridpeers.wire.plugins.plugin import KEYS, Plugin, callable_objection, plugin_of, table_of
from gridpeers.wire.plugins.registry import Registry

RETURNS = "returns"  # Judges a run whose scenario asks for it: many end before an inverter that trips may return
LAW_FAILED = "law_failed"  # Fails a run also without `--require-checks`: its numbers are not those of its law

ALWAYS = (
    "frequency", "voltage", "power_sharing", "var_sharing", "rating", "oscillation", "steady", "message_account",
    LAW_FAILED, "heal", "stale_values", "last_words",
)  # fmt: skip
"""Checks that judge every run, unless its scenario switches one off, in the order of the verdict."""

CHECKS: Registry[Any] = Registry(
    "check",
    "checks",
    lambda it: callable_objection(it, "case", (*KEYS, "name", "off")),
    own={
        name: f"gridpeers.scenarios.checks.{place}"
        for name, place in {
            "frequency": "window_checks:Frequency",
            "voltage": "window_checks:Voltage",
            "power_sharing": "window_checks:PowerSharing",
            "var_sharing": "window_checks:VarSharing",
            "rating": "run_checks:Rating",
            "oscillation": "run_checks:Oscillation",
            "steady": "window_checks:SteadyEnd",
            "returns": "run_checks:Returned",
            "law_failed": "run_checks:LawFailed",
        }.items()
    },
    reserved=ALWAYS,
)
"""Checks by name; those of plant and events come first. Those of messages are entry points of `gridpeers.lab`."""

READERS: Registry[Any] = Registry("reader of a record", "record readers", lambda it: callable_objection(it, "path"))
"""Functions of the path of a run.mcap, by the attribute of `CheckedCase` that has what they return."""


def chosen_checks(entries: Iterable[str | Mapping[str, Any]]) -> dict[str, Plugin]:
    """Return the checks of a run by their names in the verdict: those of every run, changed by a scenario's entries.

    An entry takes the place of the check that has its name; `off = true` takes that one out.
    """
    found = {name: Plugin(use=name) for name in ALWAYS}
    for entry in entries:
        table = table_of(entry)
        name, off = check_name(table), table.pop("off", False)
        table.pop("name", "")
        if off:
            found.pop(name, None)
        else:
            found[name] = plugin_of(table)
    return found


def switched_off(entries: Iterable[str | Mapping[str, Any]]) -> tuple[str, ...]:
    """Return the names of the checks of every run that a scenario's entries take out."""
    chosen = chosen_checks(entries)
    return tuple(name for name in ALWAYS if name not in chosen)


def check_name(entry: str | Mapping[str, Any]) -> str:
    """Return the name of an entry in the verdict: its own, or the last part of its reference."""
    table = table_of(entry)
    return str(table.get("name") or str(table.get("use", "")).rpartition(":")[2].rpartition(".")[2])
