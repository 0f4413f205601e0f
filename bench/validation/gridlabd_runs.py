"""The runs that our plant and GridLAB-D go through: events, set-points and limits over time."""

from __future__ import annotations

from typing import Literal, NamedTuple

import msgspec
from msgspec.structs import replace

from plant.equipment.inverter_parameters import GflParameters, GfmParameters
from plant.plant_config import PlantConfig, SwitchEvent

ONE_RATING = GflParameters(S_max=1.0, V_set_max=2.0)
"""GridLAB-D has one rating for a GFL's reference and its apparent power (ours: 1 and 1.2 pu), and no bound of V_set."""

DEAD_BANDS = GflParameters(db_UV=0.01, db_OV=0.01, db_UF=0.036, db_OF=0.036)
"""Some GFL start within their band of voltage, and some beyond it; none is on its edge."""

GFL = ("inv2", "inv3", "inv5", "inv6", "inv8", "inv9")
"""The grid-following inverters of microgrid123."""

SHORT = 0.2
"""Factor on all times of a run in the tests."""


class TimedSetPoints(NamedTuple):
    """Set-points that inverters are given in an open-loop run."""

    t: float
    """Time (s), a multiple of T_c."""
    inverters: tuple[str, ...]
    """Their names."""
    P_set: float
    """pu of the rating."""
    V_set: float
    """pu of the nominal voltage."""


class Reclosing(NamedTuple):
    """A switch that opens, and closes when its sides are an angle apart."""

    switch: str
    """Its name."""
    opens: float
    """Time (s) at which it opens, to the nearest control period."""
    angle: float
    """Angle (deg) at which it closes, its island behind."""
    further: float
    """Time (s) that the run goes on."""


class SinglePhase(NamedTuple):
    """A single-phase inverter that a run adds to the feeder's own."""

    name: str
    kind: Literal["GFM", "GFL"]
    bus: str
    phase: Literal["A", "B", "C"]
    P_rated: float
    """Rating (W)."""


class ComparedRun(NamedTuple):
    """One run: the events and limits that both plants go through."""

    text: str
    """What it is, in a few words."""
    scenario: str
    """Scenario of the catalogue that it starts from."""
    case: str
    """Its case."""
    closed_loop: bool = False
    """Whether agents give the set-points."""
    gfl: GflParameters | None = None
    """Instead of the scenario's."""
    gfm: GfmParameters | None = None
    """Instead of the scenario's."""
    events: tuple[SwitchEvent, ...] = ()
    """Instead of the scenario's."""
    set_points: tuple[TimedSetPoints, ...] = ()
    """In an open-loop run."""
    reclosing: Reclosing | None = None
    """Instead of events."""
    single_phase: tuple[SinglePhase, ...] = ()
    """Further inverters."""
    tolerance: float = 1e-8
    """Largest difference (Hz, pu) that passes."""
    in_tests: bool = True
    """Whether the tests have it too: three minutes on two cores have to do for all parts."""


ON_ONE_PHASE = (
    SinglePhase("s1", "GFL", "96", "B", 50e3),
    SinglePhase("s2", "GFL", "103", "C", 40e3),
    SinglePhase("s3", "GFL", "47", "A", 30e3),
    SinglePhase("g1", "GFM", "114", "A", 60e3),
    SinglePhase("g2", "GFM", "38", "B", 60e3),
)
"""Four on laterals of their phase, and one at a bus of three phases."""

RUNS = {
    "islanding-I": ComparedRun("constant set-points; islanding, then loss of load", "islanding", "I"),
    "islanding-IV": ComparedRun("the same in closed loop, with case IV's agents", "islanding", "IV", closed_loop=True),
    "set-points": ComparedRun(
        "set-point steps: GFL to 1.3 and -1.3 pu, GFM beyond P_max",
        "islanding",
        "I",
        gfl=ONE_RATING,
        set_points=(
            TimedSetPoints(1.5, ("inv2",), 1.3, 1.03),
            TimedSetPoints(2.0, ("inv2",), 0.647, 1.0),
            TimedSetPoints(2.5, GFL, 0.1, 1.0),  # the GFM are left with 1.8 pu
            TimedSetPoints(3.5, GFL, 0.647, 1.0),
            TimedSetPoints(5.0, ("inv3", "inv8"), 1.3, 1.0),  # f > f_nom: the droop starts from the clipped 1 pu
            TimedSetPoints(6.0, ("inv5",), -1.3, 1.0),
        ),
    ),
    "balanced-power": ComparedRun(
        "as islanding-I, GFL of balanced power: a PLL and a reference for each phase",
        "islanding",
        "I",
        gfl=GflParameters(mode="balanced_power"),
    ),
    "dead-bands": ComparedRun(
        "as islanding-I, GFL with dead bands of 0.01 pu and 0.036 Hz, whose edges they cross",
        "islanding",
        "I",
        gfl=DEAD_BANDS,
    ),
    "dead-bands-IV": ComparedRun(
        "the same in closed loop", "islanding", "IV", closed_loop=True, gfl=DEAD_BANDS, in_tests=False
    ),
    "volt-var-off": ComparedRun(
        "as islanding-I, GFL without volt-var", "islanding", "I", gfl=GflParameters(volt_var=False), in_tests=False
    ),
    "single-phase-IV": ComparedRun(
        "as islanding-IV, with three GFL and two GFM on single phases, in closed loop too",
        "islanding",
        "IV",
        closed_loop=True,
        single_phase=ON_ONE_PHASE,
    ),
    "single-phase-limits": ComparedRun(
        "single-phase set-points to 1.3 and -1.3 pu, GFM beyond P_max; GFL as current sources",
        "islanding",
        "I",
        gfl=replace(ONE_RATING, model="current_source"),
        single_phase=ON_ONE_PHASE,
        set_points=(
            TimedSetPoints(1.5, ("s1",), 1.3, 1.03),
            TimedSetPoints(2.5, ("s2",), -1.3, 1.0),
            TimedSetPoints(3.5, ("g1",), 1.4, 1.02),
            TimedSetPoints(5.0, ("g1",), -0.3, 1.0),
        ),
        in_tests=False,
    ),
    "available-power": ComparedRun(
        "available power below the reference, in closed loop", "wind-up", "clamp", closed_loop=True
    ),
    "three-islands": ComparedRun(
        "three islands, in closed loop",
        "microgrid-switching",
        "IV",
        closed_loop=True,
        # GridLAB-D de-energises microgrid 1 if both switches between the microgrids open in the same step
        events=(
            SwitchEvent(t=1.0, switch="13-152", action="open"),
            SwitchEvent(t=4.0, switch="sw1_2", action="open"),
            SwitchEvent(t=4.004, switch="sw2_3", action="open"),
        ),
    ),
    "reclosing-30": ComparedRun(
        "the substation reclosed at -30 degrees",
        "islanding",
        "I",
        reclosing=Reclosing(switch="13-152", opens=0.1, angle=30.0, further=2.0),
    ),
    "reclosing-70": ComparedRun(
        "the same at -70 degrees: down to 0.8 pu of voltage, up to 5 pu of power",
        "islanding",
        "I",
        gfm=GfmParameters(I_max=1000.0),  # 2 pu would act
        reclosing=Reclosing(switch="13-152", opens=0.1, angle=70.0, further=2.0),
        in_tests=False,
    ),
    "current-limit": ComparedRun(
        "as islanding-I, phase currents of the GFM limited to 1.8 pu, which acts for some ms",
        "islanding",
        "I",
        gfm=GfmParameters(I_max=1.8),
        tolerance=2e-5,  # both go on until no current is beyond the limit, but not by the same iterations
    ),
    "wind-up": ComparedRun(
        "available power below the reference, without anti-windup, in closed loop",
        "wind-up",
        "none",
        closed_loop=True,
        gfl=ONE_RATING,
        in_tests=False,
    ),
}


def shortened(run: ComparedRun, config: PlantConfig, factor: float) -> tuple[ComparedRun, PlantConfig]:
    """Return a run and its configuration with all times multiplied by a factor.

    They stay multiples of the control period; what comes some steps after one still does.
    """

    def at(t: float) -> float:
        ticks = int(t / config.T_c + 1e-6)
        return round(factor * ticks) * config.T_c + (t - ticks * config.T_c)

    assert config.end is not None
    settings = msgspec.structs.replace(
        config.settings,
        events=tuple(msgspec.structs.replace(event, t=at(event.t)) for event in config.settings.events),
        limits=tuple(msgspec.structs.replace(limit, t=at(limit.t)) for limit in config.settings.limits),
    )
    run = run._replace(
        set_points=tuple(each._replace(t=at(each.t)) for each in run.set_points),
        reclosing=run.reclosing and run.reclosing._replace(further=at(run.reclosing.further)),
    )
    return run, msgspec.structs.replace(config, settings=settings, end=at(config.end))
