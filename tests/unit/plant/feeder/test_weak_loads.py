"""Where the plant finds no operating point, the loads that prevent one are named."""

from __future__ import annotations

from pathlib import Path

import pytest
from msgspec.structs import replace

from gridpeers.bridges.opendss import read_opendss
from gridpeers.plant.dynamics import PlantError
from gridpeers.plant.equipment import Feeder, InverterRow
from gridpeers.plant.feeder import Plant
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import PlantSettings

pytest.importorskip("dss", reason="the import of .dss files needs the extra opendss")

SCRIPT = """Clear
New Circuit.test bus1=s basekv=12.47 pu=1.02
New Line.head bus1=s bus2=b r1=0.1 x1=0.3 r0=0.3 x0=0.9 length=1 c1=0 c0=0
New Transformer.t phases=3 windings=2 xhl=4 %loadloss=1 kvs=(12.47 0.48) kvas=(500 500) buses=(BUSES) conns=(CONNS)
New Line.low bus1=c bus2=d r1=0.01 x1=0.03 r0=0.03 x0=0.09 length=1 c1=0 c0=0
New Load.a bus1=d phases=3 conn=delta kv=0.48 kw=100 kvar=20
New Load.x bus1=d.1.2 phases=1 conn=delta kv=0.48 kw=40
UNIT
Set VoltageBases=(12.47 0.48)
CalcVoltageBases
Solve
"""

DELTA, FLOATING, GROUNDED = ("b c", "delta delta"), ("b.1.2.3.4 c", "wye delta"), ("b c", "delta wye")

GENERATOR = "New Generator.g bus1=d phases=3 kv=0.48 kw=20 model=1"
PV = "New PVSystem.pv bus1=d phases=3 kv=0.48 kva=60 pmpp=50 irradiance=1"
HARDLY_GROUNDED = f"{GENERATOR}\nNew Load.r bus1=d phases=3 kv=0.48 kw=3 model=2"


def scaled(folder: Path, connection: tuple[str, str], unit: str, factor: float) -> Feeder:
    """Import a feeder with a unit behind a transformer, its loads times a factor, and one inverter before it."""
    buses, windings = connection
    script = folder / "unit.dss"
    script.write_text(SCRIPT.replace("BUSES", buses).replace("CONNS", windings).replace("UNIT", unit))
    feeder = read_opendss(script)
    parts = tuple(
        replace(part, S=part.S * (factor if part.name.startswith("load") else 1.0)) for part in feeder.load_parts
    )
    row = InverterRow(name="i", kind="GFM", bus="b", microgrid="1", P_rated=1e6, V_nom=7200.0, m_p=0.01, m_q=0.05)
    return replace(feeder, load_parts=parts, inverters=(row,))


@pytest.mark.parametrize(
    ("connection", "unit", "name", "factor"),
    [
        (DELTA, GENERATOR, "generator.g", 1.0),
        (DELTA, GENERATOR, "generator.g", 0.05),
        (DELTA, PV, "pvsystem.pv", 1.0),
        (DELTA, PV, "pvsystem.pv", 0.05),
        (FLOATING, GENERATOR, "generator.g", 0.05),  # beside all of the load there is a point, though OpenDSS has none
        (DELTA, HARDLY_GROUNDED, "generator.g", 1.0),
        (DELTA, HARDLY_GROUNDED, "generator.g", 0.05),
    ],
)
def test_constant_power_that_nothing_grounds_is_named(
    tmp_path: Path, connection: tuple[str, str], unit: str, name: str, factor: float
) -> None:
    """At any load factor the unit is the cause, with its bus; the load as a whole is not blamed."""
    feeder = scaled(tmp_path, connection, unit, factor)

    with pytest.raises(PlantError) as refused:
        Plant(Network(feeder), PlantSettings(), 0.02, 0.02)

    assert f"cannot feed the constant power of {name} at bus d (" in str(refused.value)
    assert "the load may be more" not in str(refused.value)


def test_the_same_unit_behind_a_grounded_winding_starts(tmp_path: Path) -> None:
    """Its voltage to ground is that of the winding."""
    Plant(Network(scaled(tmp_path, GROUNDED, GENERATOR, 1.0)), PlantSettings(), 0.02, 0.02)


def test_loads_that_are_too_much_together_are_not_named(tmp_path: Path) -> None:
    """Fifteen loads of 60 kW, each of which the transformer can feed alone, are more than it can carry."""
    many = "\n".join(f"New Load.l{k} bus1=d phases=3 kv=0.48 kw=20 kvar=10 vminpu=0.1 vlowpu=0.05" for k in range(30))
    feeder = scaled(tmp_path, GROUNDED, many, 1.0)
    parts = tuple(replace(part, S=3.0 * part.S) for part in feeder.load_parts)

    with pytest.raises(PlantError, match="the load may be more than the network can carry: try smaller loads"):
        Plant(Network(replace(feeder, load_parts=parts)), PlantSettings(), 0.02, 0.02)
