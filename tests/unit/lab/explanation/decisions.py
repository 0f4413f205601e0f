"""Decisions as a record has them, made by hand."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any, cast

from gridpeers.agents.agent_config import AgentConfig, nameplate_of
from gridpeers.agents.degraded_communication import law_in_force
from gridpeers.agents.laws.call import decide
from gridpeers.agents.laws.law import Law
from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.scenarios.record.recorded_decision import NeighbourInput, RecordedDecision
from gridpeers.wire.messages import Measurement, State
from tests.toy.toy_configs import agent_config

T_C = 0.02


def state(name: str, number: int, **changes: Any) -> State:
    values: dict[str, Any] = dict(P_set=6e4, V_set=277.5, Q=1e3, island="inv1")
    return State(sender=name, epoch=1, seq=number, t=round(number * T_C, 9), **values | changes)


def neighbour(name: str, number: int | None, **changes: Any) -> NeighbourInput:
    """An in-neighbour whose last state has this number, at the decision of tick 10."""
    values: dict[str, Any] = dict(
        nameplate=nameplate_of(agent_config(name)),
        state=None if number is None else state(name, number),
        number=number,
        age=None if number is None else (10 - number) * T_C,
        weight=0.0 if number is None else 1.0,
        unused="silent" if number is None else "",
    )
    return NeighbourInput(**values | changes)


def decision(*neighbours: NeighbourInput, tick: int = 10, law: Law | None = None, **changes: Any) -> RecordedDecision:
    """The decision of inv1 at a tick, by a law or by its configuration's."""
    config: AgentConfig = changes.get("config", agent_config("inv1"))
    measurement = Measurement(
        sender="plant", epoch=1, seq=tick, t=round(tick * T_C, 9), to=config.name, P=5.5e4, Q=2e3, V=276.5, f=59.95,
        P_set=5e4, V_set=277.0, grid_connected=False, island="inv1", roster=("inv1",),
    )  # fmt: skip
    values: dict[str, Any] = dict(
        config=config,
        tick=tick,
        at=None,
        measurement=measurement,
        measurement_age=0,
        neighbours=neighbours,
        not_met=(),
        before=(5e4, 277.0),
        restarted=False,
        saturated=(0, 0),
        action="law",
        state=state(config.name, tick),
    )
    made = RecordedDecision(**values | changes)
    if "state" in changes:
        return made
    result = decide(law or law_in_force(config.control), made.own, made.neighbours_used, made.T)
    P_set, V_set = result.P_set * config.P_rated, result.V_set * config.V_nom
    return RecordedDecision(**vars(made) | {"state": state(config.name, tick, P_set=P_set, V_set=V_set)})


def record_of(*decisions: RecordedDecision, **answers: Any) -> RunRecord:
    """A record with these decisions, and with further answers by the name of the question."""

    def between(agent: str, *, since: float = 0.0, until: float = 1e9) -> Iterator[RecordedDecision]:
        return (each for each in decisions if each.agent == agent and since - 1e-9 <= each.t <= until + 1e-9)

    return cast(RunRecord, SimpleNamespace(decisions=between, **answers))
