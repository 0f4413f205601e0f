"""Two messages of each type with fixed values: one with every field, one with those alone that have no default."""

from __future__ import annotations

import math
from typing import get_type_hints

import msgspec
from msgspec.structs import replace

from gridpeers.wire.messages import (
    AgentStatus,
    Angle,
    Answer,
    Command,
    Journal,
    Leave,
    LinkAcknowledgement,
    LinkReport,
    LinkRequest,
    LoadSetting,
    Measurement,
    Message,
    Nameplate,
    Pacing,
    PlantEvent,
    Prepare,
    Ready,
    State,
    Stop,
    Telemetry,
    Waiting,
)

AGENT = dict(sender="inv2", epoch=1_764_000_000_000_001, seq=3, t=0.06)
PLANT = dict(sender="plant", epoch=7, seq=128, t=2.56)
ROW = (2.56, 59.98, 5e4, -1234.5, 277.128, 6e4, 278.0)
STATE = dict(P_set=3.25e5, V_set=277.0, Q=-1e4)
MEASUREMENT = dict(
    to="inv2", P=5e4, Q=-1234.5, V=277.128, f=59.98, P_set=6e4, V_set=278.0, grid_connected=True, island="grid"
)
LINK_COMMAND = {"set": {"on": "inv4 -> inv7", "loss": 0.05, "delay": {"model": "constant", "delay_s": 0.1}}}
STATUS = dict(
    phase="running", waits_for="", island="inv1", neighbours=("inv1", "inv3"), ages=(0.02, -1.0), used=("inv1",),
    received=70_000, sent=256, rejected=1, lost=2, ticks=128, missed=3, lateness=0.0015,
)  # fmt: skip
TELEMETRY = dict(inverters=("inv1",), final=True, outcome="", reproducible=False)
EVENT = PlantEvent(t=2.5, kind="load", subject="48", text="Kapazität", P=1e5, Q=-5e4)

WHOLE: tuple[Message, ...] = (
    Nameplate(kind="GFM", microgrid="MG 1", P_rated=1e5, V_nom=277.0, f_nom=60.0, m_p=0.01, m_q=0.05, **AGENT),
    Measurement(roster=("inv1", "inv2"), **MEASUREMENT, **PLANT),
    State(
        island="inv1", angle=Angle(cycles=-0.5, since=1.0), idle=True, shared={"omega": 0.1}, quiet=True, skipped=300,
        fault="law failed", **STATE, **AGENT,
    ),
    Prepare(roster=("inv1", "inv2"), instances=("a1", "b2"), **PLANT),
    Waiting(waits_for=("inv3",), **PLANT),
    Ready(**AGENT),
    Stop(reason="end of the scenario", refused=True, **PLANT),
    Leave(**AGENT),
    LinkReport(data=b"\x00\xffbook", instance="a1", final=True, **AGENT),
    Journal(data=b"\x00\xffentries", **AGENT),
    LinkRequest(link_command=LINK_COMMAND, reply_to="z1", **PLANT),
    LinkAcknowledgement(ok=True, text="inv4 -> inv7", reply_to="z1", data=b"\x80", **AGENT),
    Command(
        verb="load", argument="48", link_command=LINK_COMMAND, load=LoadSetting(factor=1.5, P=1e5, Q=-5e4),
        reply_to="z1", **AGENT,
    ),
    Answer(ok=True, text="done", data={"t": 2.56, "present": ["inv1", None]}, **PLANT),
    AgentStatus(impaired=("inv3",), **STATUS, **AGENT),
    Telemetry(
        rows=(ROW, (2.58, math.nan, math.inf, *ROW[3:])),
        events=(EVENT, PlantEvent(t=2.52, kind="switch", subject="13-152", text="opened", closed=False)),
        pacing=Pacing(steps=9, late=1, p50=1e-4, p95=2e-4, p99=3e-4, worst=0.01, slipped=0.5), awaited=("inv4",),
        impaired=("inv3",), quiet=((2.56, 4),), others=5, **TELEMETRY, **PLANT,
    ),
)  # fmt: skip

LEAST: tuple[Message, ...] = (
    Measurement(**MEASUREMENT, **PLANT),
    State(**STATE, **AGENT),
    Stop(reason="enough", **PLANT),
    LinkReport(data=b"", **AGENT),
    LinkAcknowledgement(ok=False, text="no", reply_to="z1", **AGENT),
    Command(verb="status", reply_to="z1", **AGENT),
    Answer(ok=False, text="no", **PLANT),
    AgentStatus(**STATUS, **AGENT),
    Telemetry(rows=(ROW,), events=(), **TELEMETRY, **PLANT),
)
"""Of the types that have fields with defaults."""


VALUES: dict[type, object] = {float: 0.5, int: 1, str: "x", bool: True, bytes: b"x"}
"""Values of a new field, by type, until somebody gives it a better one above: each within the bounds of most fields."""


def filled(message: Message) -> Message:
    """Return a message whose fields at their default have another value, where the type says which."""
    kinds = get_type_hints(type(message))
    return replace(message, **{name: VALUES[kinds[name]] for name in with_defaults(message) if kinds[name] in VALUES})


def with_defaults(message: Message) -> set[str]:
    """Return the fields of a message that have their default."""
    return {
        field.name
        for field in msgspec.structs.fields(type(message))
        if not field.required and getattr(message, field.name) == field.default
    }
