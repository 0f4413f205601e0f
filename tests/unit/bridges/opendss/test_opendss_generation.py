"""Generators, photovoltaic systems and storage deliver the power that they deliver in the OpenDSS engine."""

from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from gridpeers.bridges.opendss import read_opendss
from gridpeers.plant.network import Network, solve_power_flow
from gridpeers.plant.tables import read_feeder
from gridpeers.plant.tables.write import write_feeder
from tests.unit.bridges.opendss.opendss_scripts import GENERATION, UNEVEN
from tests.unit.bridges.opendss.opendss_solutions import LETTERS, LINE, STEP_DOWN, TOLERANCE, engine_voltages, write

pytest.importorskip("dss", reason="the import of .dss files needs the extra opendss")

LIMITS = "kv=0.48 vminpu=0.9 vmaxpu=1.1"
BEYOND = {
    **{f"model {model}": f"New Generator.g bus1=c kw=50 kvar=10 model={model} {LIMITS}" for model in (1, 2, 4, 5)},
    "voltage-controlled": f"New Generator.g bus1=c kw=50 kvar=20 model=3 maxkvar=20 minkvar=20 {LIMITS}",
    "limited current": f"New Generator.g bus1=c kw=50 pf=1 model=7 {LIMITS}",
    "fixed kvar, delta": f"New Generator.g bus1=c kw=50 kvar=10 model=4 conn=delta {LIMITS}",
    "photovoltaic": f"New PVSystem.p bus1=c kva=50 pmpp=40 kvar=12 {LIMITS}",
    "photovoltaic of limited current": f"New PVSystem.p bus1=c kva=50 pmpp=40 kvar=12 limitcurrent=yes {LIMITS}",
    "storage": f"New Storage.s bus1=c kwrated=50 kwhrated=100 state=discharging {LIMITS}",
    "storage of limited current": f"New Storage.s bus1=c kwrated=50 limitcurrent=yes state=discharging {LIMITS}",
    "negative load": f"New Load.l bus1=c phases=3 kw=-90 kvar=30 {LIMITS}",
}
"""Generation of each law; that of the Generator's model 7 beyond its limit has its vars reversed in the engine."""


@pytest.mark.parametrize("pu", [0.7, 1.16])
@pytest.mark.parametrize("kind", BEYOND)
def test_generation_beyond_its_limits_is_that_of_the_engine(tmp_path: Path, kind: str, pu: float) -> None:
    """A snapshot at 1.02 pu, taken to a voltage below Vminpu or above Vmaxpu, has the engine's voltages there."""
    uneven = "New Load.uneven bus1=c.1.2 phases=1 kv=0.48 kw=60 kvar=10 model=2"
    path = write(tmp_path, LINE, STEP_DOWN, uneven, BEYOND[kind])
    feeder = read_opendss(path)
    path.write_text(path.read_text().replace("pu=1.02", f"pu={pu}"))
    assert feeder.source

    network = Network(replace(feeder, source=replace(feeder.source, V_pu=feeder.source.V_pu * pu / 1.02)))
    V = solve_power_flow(network, network.closed0)

    for name, theirs in engine_voltages(path).items():
        bus, _, number = name.rpartition(".")
        node = network.index(bus, LETTERS[int(number) - 1])
        assert abs(V[node] - theirs) < TOLERANCE * network.V_nom[node]


@pytest.mark.parametrize("kind", ["fixed kvar, delta", "limited current"])
def test_tables_have_generation_of_each_law(tmp_path: Path, kind: str) -> None:
    """What is read from the tables of an imported feeder is what was imported."""
    feeder = read_opendss(write(tmp_path, LINE, STEP_DOWN, BEYOND[kind]))

    write_feeder(feeder, tmp_path / "tables")

    assert read_feeder(str(tmp_path / "tables")).load_parts == feeder.load_parts


@pytest.mark.parametrize("kind", ["photovoltaic", "negative load"])
def test_generation_disconnects_above_1_2_pu(tmp_path: Path, kind: str) -> None:
    """At 1.25 pu nothing is delivered: beyond Vmaxpu the engine has a negative impedance at any voltage."""
    feeder = read_opendss(write(tmp_path, LINE, STEP_DOWN, BEYOND[kind]))
    assert feeder.source

    network = Network(replace(feeder, source=replace(feeder.source, V_pu=1.25)))

    V = solve_power_flow(network, network.closed0)
    assert network.loads().powers(V).sum() + V @ np.conj(network.Y_loads @ V) == pytest.approx(0.0, abs=1.0)


def test_generation_is_told_and_no_load(tmp_path: Path) -> None:
    """A note says how much an element delivers; it counts as generation, and one that delivers nothing is left out."""
    idle = "New Generator.idle bus1=c kv=0.48 kw=0 kvar=0"
    feeder = read_opendss(write(tmp_path, LINE, STEP_DOWN, UNEVEN, GENERATION["generator"], idle))

    assert feeder.notes == (
        "generator.g: delivers 50 kW and 10 kvar as in the snapshot, constant",
        "generator.idle: delivers nothing; left out",
    )
    assert feeder.generation_by_bus() == {"c": pytest.approx(50e3)}
    assert feeder.load_by_bus() == {"c": pytest.approx(60e3)}
