"""The runs that our plant and GridLAB-D go through: events, set-points and limits over time (gridlabd_runs.toml)."""

from __future__ import annotations

import tomllib
from pathlib import Path

import msgspec
from msgspec.structs import replace

from bench.validation.validation_part import Kind
from gridpeers.plant.inverters.gfl import Gfl
from gridpeers.plant.inverters.gfm_droop import GfmDroop
from gridpeers.plant.plant_config import PlantConfig, SwitchEvent

SHORT = 0.2
"""Factor on all times of a run in the tests."""


class TimedSetPoints(msgspec.Struct, frozen=True):
    """Set-points that inverters are given in an open-loop run."""

    t: float
    """Time (s), a multiple of T_c."""
    inverters: tuple[str, ...]
    P_set: float
    """pu of the rating."""
    V_set: float
    """pu of the nominal voltage."""


class Reclosing(msgspec.Struct, frozen=True):
    """A switch that opens, and closes when its sides are an angle apart."""

    switch: str
    opens: float
    """Time (s) at which it opens, to the nearest control period."""
    angle: float
    """Angle (deg) at which it closes, its island behind."""
    further: float
    """Time (s) that the run goes on."""


class ComparedRun(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One run: the events and limits that both plants go through; what is left out is the scenario's."""

    text: str
    """Title in the table."""
    case: str
    """Case of the scenario."""
    scenario: str = "islanding"
    """Scenario of the catalogue that it starts from."""
    gfl: Gfl | None = None
    """S_max 1 pu is GridLAB-D's one rating of a GFL's reference and apparent power; it has no bound of V_set."""
    gfm: GfmDroop | None = None
    events: tuple[SwitchEvent, ...] = ()
    set_points: tuple[TimedSetPoints, ...] = ()
    reclosing: Reclosing | None = None
    """Instead of events."""
    single_phase: bool = False
    """True if the inverters of `ON_ONE_PHASE` are added."""
    tolerance: float = 1e-8
    """Largest difference (Hz, pu) that passes."""
    in_tests: bool = True
    """True if the tests make this run too; they have time for some of them only."""

    @property
    def closed_loop(self) -> bool:
        """Whether agents give the set-points."""
        return self.case != "I"


ON_ONE_PHASE: tuple[tuple[str, Kind, str, str, float], ...] = (
    ("s1", "GFL", "96", "B", 50e3),
    ("s2", "GFL", "103", "C", 40e3),
    ("s3", "GFL", "47", "A", 30e3),
    ("g1", "GFM", "114", "A", 60e3),
    ("g2", "GFM", "38", "B", 60e3),
)
"""Name, kind, bus, phase and rating (W); four on laterals of their phase, and one at a bus of three phases."""

RUNS = msgspec.convert(
    tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8")), dict[str, ComparedRun]
)


def shortened(run: ComparedRun, config: PlantConfig, factor: float) -> tuple[ComparedRun, PlantConfig]:
    """Return a run and its configuration with all times multiplied by a factor.

    They stay multiples of the control period; what comes some steps after one still does.
    """

    def at(t: float) -> float:
        ticks = int(t / config.T_c + 1e-6)
        return round(factor * ticks) * config.T_c + (t - ticks * config.T_c)

    assert config.end is not None
    settings = replace(
        config.settings,
        events=tuple(replace(event, t=at(event.t)) for event in config.settings.events),
        limits=tuple(replace(limit, t=at(limit.t)) for limit in config.settings.limits),
    )
    run = replace(
        run,
        set_points=tuple(replace(each, t=at(each.t)) for each in run.set_points),
        reclosing=run.reclosing and replace(run.reclosing, further=at(run.reclosing.further)),
    )
    return run, replace(config, settings=settings, end=at(config.end))
