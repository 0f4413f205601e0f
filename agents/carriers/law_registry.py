"""The registry of laws, which the key `law` of a scenario names; how a law is made and ended."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from gridpeers.agents.agent_config import Control, LawChoice, SharedQuantity
from gridpeers.agents.carriers.time_limit import make_limited
from gridpeers.agents.degraded_communication import law_in_force
from gridpeers.agents.laws.law import Law
from gridpeers.wire.messages import SHARED_LIMIT
from gridpeers.wire.plugins.plugin import class_objection
from gridpeers.wire.plugins.registry import PluginError, Registry
from gridpeers.wire.schema.table_schema import Plausible, Range, shared_fields

CARRIERS = ("use", "command", "fmu")  # Keys of a scenario's table `law`; one of them names the law

KEYS = (*CARRIERS, "shared", "folder", "time_limit_s")


def _objection(it: Any) -> str:
    return class_objection(it, Law, "step", ("own", "neighbours", "T"), KEYS)


LAWS: Registry[type[Law]] = Registry(
    "law",
    "laws",
    _objection,
    own={
        "consensus": "gridpeers.agents.laws.consensus:Consensus",
        "dapi": "gridpeers.agents.laws.dapi:Dapi",
        "event-triggered": "gridpeers.agents.laws.event_triggered:EventTriggered",
        "finite-time": "gridpeers.agents.laws.finite_time:FiniteTime",
        "centralised": "gridpeers.agents.laws.centralised:Centralised",
        "resilient": "gridpeers.agents.laws.resilient:Resilient",
    },
)


def make_law(control: Control) -> Law:
    choice = control.law
    if choice.command:
        from gridpeers.agents.carriers.program import ProgramLaw

        return ProgramLaw(choice)
    if choice.fmu:
        from gridpeers.agents.carriers.fmu import FmuLaw

        return FmuLaw(choice)
    if choice.use == LawChoice().use:
        return law_in_force(control)
    law = LAWS.resolve(choice.use, choice.folder)
    try:
        return make_limited(law, choice.parameters, choice.time_limit)
    except ValueError as error:
        raise ValueError(f"law {choice.use} {error}") from error


def shared_by(choice: LawChoice) -> tuple[SharedQuantity, ...]:
    """Return the quantities that a law of any carrier declares; none if the law is missing here."""
    if choice.command:
        return choice.shared
    if choice.fmu:
        from gridpeers.agents.carriers.fmu import shared_by_fmu

        return shared_by_fmu(Path(choice.folder) / choice.fmu)
    try:
        fields = shared_fields(LAWS.resolve(choice.use, choice.folder))
    except PluginError:  # the check of the scenario reports it
        return ()
    found = []
    for field in fields:
        bounds = field.mark((Range, Plausible)) or Range()
        low, high = max(bounds.low, -SHARED_LIMIT), min(bounds.high, SHARED_LIMIT)
        found.append(SharedQuantity(name=field.name, unit=field.unit, low=low, high=high, help=field.help))
    return tuple(found)


def close_laws(laws: Iterable[Law]) -> None:
    """End some laws; all programs are asked to end before the first wait."""
    ended = tuple(laws)
    for law in ended:
        if end_input := getattr(law, "end_input", None):  # only a program has one
            end_input()
    for law in ended:
        law.close()
