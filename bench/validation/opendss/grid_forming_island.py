"""An island of the microgrid feeder behind one grid-forming storage, as a script for OpenDSS and as our feeder.

The storage stands at 480 V behind a delta-wye transformer: OpenDSS's grid-forming source needs one, because its two
engines give it different impedances of zero sequence, and with `conn=wye` neither gives what `conn=delta` means.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from bench.validation.opendss.write_opendss import LIMITS, write_opendss
from plant.equipment import Bus, Feeder, InverterRow, Source
from plant.equipment.imported_equipment import LinearElement

BUS, EMF = "gfm", "emf"
"""Bus of the storage, and behind its impedance."""

AT = "160"
"""Where the transformer meets the feeder."""

V_LL = 480.0
"""V, line-to-line, nominal voltage of the storage."""

S_RATED = 4e6
"""Rating of storage and transformer (VA)."""

Z_T = 0.005 + 0.05j
"""Of the transformer (pu)."""

X_GFM = 1e-3 / sqrt(1.0625)
"""Reactance of OpenDSS's grid-forming source (pu): kV^2/kVA, taken as ohm; its resistance is a quarter of it."""

Z_GFM = complex(X_GFM / 4.0, X_GFM)

FLOATING = 1e-9
"""Shunt that keeps the floating delta side in the matrix (S)."""

ISLANDING, SHEDDING = "13-152", "60-160"
"""The switch that islands the feeder, and the one that then sheds a zone."""

STATES = (
    (f"open line.{ISLANDING} 1", "edit storage.gfm state=discharging controlmode=gfm"),
    ("set mode=dynamics stepsize=0.001 number=500",),
    (f"open line.{SHEDDING} 1", "set stepsize=1e-6 number=1"),
    ("set stepsize=0.001 number=500",),
)
"""Commands that lead to each state; each is solved twice.

Islanded snapshot; 1 s of dynamics from zero voltage; a zone is shed, 2 us later; 1 s later.
"""


def island_script(feeder: Feeder) -> str:
    """Return the script, connected to the substation and with the storage idle.

    Loads become impedances below 0.85 pu, so that OpenDSS's start from zero voltage has solutions; in the states that
    are compared no voltage is that low.
    """
    rating = f"{S_RATED / 1e3!r}"
    kV = V_LL / 1e3
    V_nom = {bus.name: bus.V_nom for bus in feeder.buses}[AT] * sqrt(3.0) / 1e3
    return f"""{write_opendss(feeder).replace(LIMITS, "vminpu=0.85 vlowpu=0.005 vmaxpu=9")}
New Transformer.stepup phases=3 xhl={Z_T.imag * 100!r} %loadloss={Z_T.real * 100!r} ppm_antifloat=0.001
~ buses=({BUS} {AT}) conns=(delta wye) kvs=({kV!r} {V_nom!r}) kvas=({rating} {rating})
New Storage.gfm phases=3 conn=delta bus1={BUS} kV={kV!r} kva={rating} kWrated={rating} kWhrated=1000000 %stored=100
~ %reserve=0 %EffCharge=100 %EffDischarge=100 %IdlingkW=0 state=idling kp=0.01 pitol=0.1 safevoltage=0
Set VoltageBases=({kV!r} {V_nom!r})
CalcVoltageBases
Solve
"""


def behind_source(feeder: Feeder) -> Feeder:
    """Return our feeder, fed by 1 pu behind the storage's impedance instead of the substation."""
    V_nom = V_LL / sqrt(3.0)
    nodes = tuple((bus, phase) for bus in (EMF, BUS) for phase in "ABC")
    y = 1.0 / (Z_GFM * V_LL**2 / S_RATED)
    link = LinearElement(name="source", nodes=nodes, Y=_matrix(np.kron(np.array([[y, -y], [-y, y]]), np.eye(3))))
    buses = (*feeder.buses, Bus(name=BUS, phases="ABC", V_nom=V_nom), Bus(name=EMF, phases="ABC", V_nom=V_nom))
    source = Source(bus=EMF, V_pu=1.0, angle=0.0)
    return replace(feeder, buses=buses, elements=(link, _transformer(feeder)), inverters=(), source=source)


def behind_inverter(feeder: Feeder) -> Feeder:
    """Return our feeder with a grid-forming inverter as the storage; the substation stays behind its switch."""
    V_nom = V_LL / sqrt(3.0)
    unit = InverterRow(name="gfm", kind="GFM", bus=BUS, microgrid="", P_rated=S_RATED, V_nom=V_nom, m_p=0.01, m_q=0.05)
    buses = (*feeder.buses, Bus(name=BUS, phases="ABC", V_nom=V_nom))
    return replace(feeder, buses=buses, elements=(_transformer(feeder),), inverters=(unit,))


def delivered(feeder: Feeder, V_low: NDArray[np.complex128], V_high: NDArray[np.complex128]) -> complex:
    """Return the power into the transformer (VA) from the phasors at its two sides (V)."""
    Y = np.array(_transformer(feeder).Y)
    return complex(np.vdot((Y @ np.concatenate([V_low, V_high]))[:3], V_low))


def _transformer(feeder: Feeder) -> LinearElement:
    """Return the transformer: winding k of the delta side is between phases k and k + 1."""
    V_nom = {bus.name: bus.V_nom for bus in feeder.buses}[AT]
    turns = V_LL / V_nom
    y = S_RATED / 3.0 / V_LL**2 / Z_T
    delta = np.eye(3) - np.roll(np.eye(3), 1, axis=1)
    windings = np.hstack([delta, -turns * np.eye(3)])
    Y = y * windings.T @ windings + 1j * FLOATING * np.diag([1, 1, 1, 0, 0, 0])
    return LinearElement(name="stepup", nodes=tuple((bus, phase) for bus in (BUS, AT) for phase in "ABC"), Y=_matrix(Y))


def _matrix(Y: NDArray[np.complex128]) -> tuple[tuple[complex, ...], ...]:
    return tuple(tuple(map(complex, row)) for row in Y)
