"""The columns of a feeder's tables: type, unit, range and meaning of each. A class is a file, an object a row.

Other columns (origin, note) are free.

A range is wide: it holds every value that a distribution feeder may have, and none that only a lost unit explains.
`power_of` gives ranges that depend on a bus's voltage.
"""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec

from gridpeers.plant.equipment import F_NOM
from gridpeers.plant.tables.csv_table import PhaseLetters
from gridpeers.wire.schema.table_schema import Label, Plausible, Range, Unit

SELF_R = Plausible("the resistance of a line", 1e-3, 20.0, above_zero=True)
SELF_X = Plausible("the reactance of a line", 1e-3, 20.0, above_zero=True)
SELF_B = Plausible("the susceptance of a line", 0.0, 2000.0)
MUTUAL = Plausible("a mutual impedance", -10.0, 10.0)
MUTUAL_B = Plausible("the susceptance of a line", -2000.0, 2000.0)
RATIO = Plausible(
    "the ratio of a regulator", 0.8, 1.25, hint="; tap is a number of steps, as 5 or -3, each of 0.00625 pu as a rule"
)
BRANCH_CURRENT = 2000.0  # largest current of a load or capacitor bank (A per phase): conductors carry less
PART_CURRENT = 50e3  # the same of a load that another program has: it may stand for a town
RATED_CURRENT = 5000.0  # largest rated current of an inverter or transformer (A per phase)
TIMES_THE_LOAD = 50.0  # largest rating of one inverter beside the total real power of the feeder's loads
SOURCE_VOLTAGE = Plausible("the voltage of the substation", 0.8, 1.2, above_zero=True)

Phases = Annotated[str, PhaseLetters()]
OhmPerKm = Annotated[float, Unit("ohm/km")]
LoadW = Annotated[float, Unit("kW"), "Real power at nominal voltage."]
LoadVar = Annotated[float, Unit("kvar"), "Reactive power at nominal voltage."]
Exponent = Annotated[float, Plausible("a power of the voltage", -5.0, 10.0)]
LimitOfV = Annotated[float, Unit("pu"), Plausible("a limit of the voltage", 0.0, 5.0)]
BankVar = Annotated[float, Unit("kvar"), Range(low=0.0), "Reactive power at V_rated_kV_LN."]


class BusColumns(msgspec.Struct, frozen=True, kw_only=True):
    """buses.csv: the order of the rows is the order of the nodes everywhere."""

    bus: Annotated[str, "Name."]
    phases: Annotated[str, PhaseLetters(stand_in="ABC"), "Its phases."]
    V_nom_kV_LL: Annotated[float, Unit("kV", in_key=False), Plausible("a nominal voltage", 0.1, 800.0, above_zero=True)]
    """Nominal voltage, line-to-line."""
    zone: Annotated[str, "Part of the feeder."] = ""
    x: Annotated[float, "Place in a drawing (any unit)."] = 0.0
    y: Annotated[float, "Place in a drawing (any unit)."] = 0.0


class ImportedBusColumns(BusColumns, frozen=True, kw_only=True):
    """buses.csv of a feeder with elements.csv: neutrals and the like are further letters of `phases`, 4, 5, ...."""

    phases: Annotated[str, PhaseLetters(stand_in="ABC", others=True), "Its phases and further nodes."]


class LineColumns(msgspec.Struct, frozen=True, kw_only=True):
    """lines.csv."""

    line: Annotated[str, "Name."]
    from_bus: Annotated[str, "One end."]
    to_bus: Annotated[str, "The other end."]
    phases: Annotated[Phases, "Its phases."]
    config: Annotated[str, "Its impedances, by their name in line_configs.csv."]
    length_m: Annotated[float, Unit("m"), Plausible("the length of a line", 0.1, 1e5, above_zero=True), "Length."]


class LineConfigColumns(msgspec.Struct, frozen=True, kw_only=True):
    """line_configs.csv: one element of the upper triangle of the matrices a row, at nominal frequency."""

    config: Annotated[str, "Name of the configuration."]
    phase_1: Annotated[Literal["A", "B", "C"], Label("phase"), "Row of the element."]
    phase_2: Annotated[Literal["A", "B", "C"], Label("phase"), "Column of the element."]
    R_ohm_per_km: Annotated[OhmPerKm, "Resistance; above 0 on the diagonal."]
    X_ohm_per_km: Annotated[OhmPerKm, "Reactance; above 0 on the diagonal."]
    B_uS_per_km: Annotated[float, Unit("uS/km"), "Shunt susceptance."]


class SwitchColumns(msgspec.Struct, frozen=True, kw_only=True):
    """switches.csv: the name of a switch is its two buses, "13-152", or its alias, "sw1_2"."""

    from_bus: Annotated[str, "One end."]
    to_bus: Annotated[str, "The other end."]
    phases: Annotated[str, PhaseLetters(others=True)]
    """Phases that it switches, and further nodes of its buses."""
    state: Annotated[Literal["closed", "open"], Label("state of a switch"), "Position at the start."]
    alias: Annotated[str, "Second name."] = ""


class RegulatorColumns(msgspec.Struct, frozen=True, kw_only=True):
    """regulators.csv: V_to = (1 + tap tap_step_pu) V_from, fixed; one row for all phases on the same tap."""

    regulator: Annotated[str, "Name."]
    from_bus: Annotated[str, "Input."]
    to_bus: Annotated[str, "Output."]
    phases: Annotated[Phases, "Phases on this tap."]
    tap: Annotated[float, "Number of steps, as in 5 or -3."]
    tap_step_pu: Annotated[float, Unit("pu"), Plausible("a step of a regulator", 1e-5, 0.25, above_zero=True)]
    """Length of a step, 0.00625 as a rule."""


class TransformerColumns(msgspec.Struct, frozen=True, kw_only=True):
    """transformers.csv: rated voltages are the nominal voltages of the buses. Behind D-D nothing has ground."""

    transformer: Annotated[str, "Name."]
    from_bus: Annotated[str, "One side."]
    to_bus: Annotated[str, "The other side."]
    connection: Annotated[Literal["D-D", "Yg-Yg"], Label("connection of a transformer")]
    """Delta on both sides, or star with ground on both."""
    S_rated_kVA: Annotated[float, Unit("kVA"), Plausible("the rating of a transformer", 1.0, 1e6, above_zero=True)]
    """Rated power."""
    R_percent: Annotated[float, Unit("%"), Plausible("the resistance of a transformer", 0.0, 20.0)]
    """Resistance, of the rating."""
    X_percent: Annotated[float, Unit("%"), Plausible("the reactance of a transformer", 0.1, 40.0, above_zero=True)]
    """Reactance, of the rating."""


class LoadColumns(msgspec.Struct, frozen=True, kw_only=True):
    """loads_SET.csv: powers per phase; for a delta load a, b, c are A-B, B-C, C-A."""

    bus: Annotated[str, "Its bus."]
    connection: Annotated[Literal["Y", "D"], Label("connection of a load"), "Star with ground, or delta."]
    model: Annotated[Literal["P", "I", "Z"], Label("load model"), "Constant power, current or impedance."]
    P_a_kW: LoadW
    Q_a_kvar: LoadVar
    P_b_kW: LoadW
    Q_b_kvar: LoadVar
    P_c_kW: LoadW
    Q_c_kvar: LoadVar


class CapacitorColumns(msgspec.Struct, frozen=True, kw_only=True):
    """capacitors.csv: banks from phase to ground."""

    bus: Annotated[str, "Its bus."]
    Q_a_kvar: BankVar
    Q_b_kvar: BankVar
    Q_c_kvar: BankVar
    V_rated_kV_LN: Annotated[
        float, Unit("kV", in_key=False), Plausible("a rated voltage", 0.05, 150.0, above_zero=True)
    ]
    """Rated voltage, line-to-neutral; 0.9 to 1.5 times the nominal one of its bus."""


class InverterColumns(msgspec.Struct, frozen=True, kw_only=True):
    """inverters.csv: nameplates and places, at most one inverter on each phase of a bus."""

    name: Annotated[str, "Name, a part of keys on the wire."]
    kind: Annotated[Literal["GFM", "GFL"], Label("kind of inverter"), "Grid-forming or grid-following."]
    bus: Annotated[str, "Its bus."]
    microgrid: Annotated[str, "Name of its microgrid."]
    P_rated_kW: Annotated[float, Unit("kW"), Plausible("the rating of an inverter", 0.01, 1e6, above_zero=True)]
    """Rated power of all its phases, the base of its per-unit values."""
    m_p_pu: Annotated[float, Unit("pu"), Plausible("a P-f droop", 0.001, 0.2, above_zero=True)]
    """P-f droop (pu frequency per pu power)."""
    m_q_pu: Annotated[float, Unit("pu"), Plausible("a Q-V droop", 0.001, 0.5, above_zero=True)]
    """Q-V droop (pu voltage per pu reactive power)."""
    phases: Literal["ABC", "A", "B", "C"] = "ABC"
    """Phases of the bus to which it is connected: all three, or one for a single-phase inverter."""
    spare: Annotated[Literal["", "yes"], '"yes" if it is switched off until an agent joins for it.'] = ""
    parameters: str = ""
    """Name of a published set of parameters, "regfm_a1"; empty: those of its kind."""
    neutral: str = ""
    """Node of the bus to which its phases return, or "earth"; empty: the neutral of the loads, else earth."""


class SourceColumns(msgspec.Struct, frozen=True, kw_only=True):
    """source.csv: the substation, a stiff voltage, at most one. Without it only inverters feed."""

    bus: Annotated[str, "Its bus, of three phases."]
    V_pu: Annotated[float, Unit("pu"), SOURCE_VOLTAGE, "Voltage."]
    angle_deg: Annotated[float, Unit("deg"), Plausible("the angle of the substation", -360.0, 360.0)]
    """Angle of phase A."""


class ElementColumns(msgspec.Struct, frozen=True, kw_only=True):
    """elements.csv: linear elements of a feeder of another program, by their admittances."""

    element: Annotated[str, 'Name, as in that program: "transformer.sub".']
    nodes: Annotated[str, "Its nodes, bus.phase, with spaces between them."]
    Y_S: Annotated[str, "Its primitive admittance matrix (S), row by row, with spaces between the numbers: 1.5-2.5j."]


class LoadPartColumns(msgspec.Struct, frozen=True, kw_only=True):
    """load_parts_SET.csv: loads of such a feeder, phase by phase; their power depends on powers of the voltage."""

    load: Annotated[str, "Name, as in that program."]
    bus: Annotated[str, "Its bus."]
    from_phase: Annotated[str, "One end."]
    to_phase: Annotated[str, "The other end; empty for ground."] = ""
    P_kW: LoadW
    Q_kvar: LoadVar
    V_nom_kV: Annotated[float, Unit("kV", in_key=False), Plausible("a nominal voltage", 0.01, 150.0, above_zero=True)]
    """Nominal voltage across it."""
    n_P: Exponent = 0.0
    """Exponent of the voltage in P: 0 constant power, 1 constant current, 2 constant impedance."""
    n_Q: Annotated[Exponent, "The same for Q."] = 0.0
    V_low_pu: Annotated[LimitOfV, "Voltage below which it is its nominal impedance."] = 0.0
    V_min_pu: LimitOfV = 0.0
    """Voltage below which it becomes that impedance, or keeps its current if V_low is the same; 0: no limit."""
    V_max_pu: Annotated[LimitOfV, "Voltage above which it is an impedance; 0: no limit."] = 0.0
    edge: Annotated[Exponent, "Exponent by which its current meets these limits."] = 0.0
    V_off_pu: Annotated[LimitOfV, "Voltage below which it drops out; 0: it never does."] = 0.0
    V_off_above_pu: Annotated[LimitOfV, "Voltage above which it drops out; 0: it never does."] = 0.0


class Manifest(msgspec.Struct, frozen=True, kw_only=True):
    """feeder.toml, which may be missing: data of the whole feeder."""

    f_nom_Hz: Annotated[float, Unit("Hz"), Plausible("a nominal frequency", 16.0, 400.0)] = F_NOM
    """Nominal frequency, at which the impedances are given."""


TABLES: dict[str, type[msgspec.Struct]] = {
    "buses.csv": BusColumns,
    "lines.csv": LineColumns,
    "line_configs.csv": LineConfigColumns,
    "switches.csv": SwitchColumns,
    "regulators.csv": RegulatorColumns,
    "transformers.csv": TransformerColumns,
    "capacitors.csv": CapacitorColumns,
    "inverters.csv": InverterColumns,
    "source.csv": SourceColumns,
    "elements.csv": ElementColumns,
}

LOAD_SETS: dict[str, type[msgspec.Struct]] = {"loads_": LoadColumns, "load_parts_": LoadPartColumns}


def power_of(what: str, V_nom: float, current: float, phases: int) -> Plausible:
    """Return the range of a power (kW, kvar, kVA) whose current (A per phase) stays below a bound."""
    high = phases * V_nom * current / 1e3
    where = f"{what} {'on a phase of' if phases == 1 else 'at'} {V_nom * 3.0**0.5 / 1e3:.3g} kV"
    return Plausible(where, -high, high)
