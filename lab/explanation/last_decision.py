"""What became of an inverter whose agent has decided no more: when the agent left, and what its inverter does."""

from __future__ import annotations

from collections.abc import Sequence

from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.scenarios.record.recorded_decision import RecordedDecision
from gridpeers.wire.messages import VALUES, PlantEvent

SILENT = 10
"""Control periods without a decision after which the inverter is looked at, though nothing says that its agent left."""


def aftermath(
    record: RunRecord, decision: RecordedDecision, asked: float, events: Sequence[PlantEvent]
) -> tuple[str, ...]:
    """Return in sentences what happened between a decision and a later run time (s) for which there is no other one.

    Empty if the decision is of that time.
    """
    T_c = decision.config.T_c
    if asked - decision.t <= 1.5 * T_c:
        return ()
    about = [
        event
        for event in events
        if event.kind == "roster" and event.subject == decision.agent and decision.t - T_c < event.t <= asked + 1e-9
    ]
    last = f"it is the last decision before {asked:g} s"
    if not about and asked - decision.t < SILENT * T_c:
        return (last,)
    left = f": {about[-1].text}" if about else ""
    return last + left, *_inverter(record, decision, asked)


def _inverter(record: RunRecord, decision: RecordedDecision, t: float) -> tuple[str, ...]:
    """Return in a sentence what the inverter of an agent does at a run time (s); nothing if no row tells."""
    values = _row(record, decision.agent, t)
    if values is None:
        return ()
    _, P, Q, _, P_set, V_set = values
    if P == Q == 0.0:  # the plant reports exactly no power of an inverter that is off the network
        return (f"at {t:g} s its inverter is off the network",)
    holds = (
        "these set-points"
        if (P_set, V_set) == decision.after
        else f"P_set = {P_set / 1e3:.2f} kW, V_set = {V_set:.2f} V"
    )
    return (f"at {t:g} s its inverter is on the network, delivers {P / 1e3:.2f} kW, and keeps {holds}",)


def _row(record: RunRecord, inverter: str, t: float) -> tuple[float, ...] | None:
    """Return f, P, Q, V, P_set and V_set of an inverter in the last row up to a run time (s)."""
    found: tuple[float, tuple[float, ...]] | None = None
    for message in record.telemetry(since=max(0.0, t - 1.0), until=t):
        if inverter in message.inverters:
            start = 1 + VALUES * message.inverters.index(inverter)
            for row in message.rows:
                if row[0] <= t + 1e-9 and (found is None or row[0] > found[0]):
                    found = row[0], row[start : start + VALUES]
    return None if found is None else found[1]
