"""Generators, photovoltaic systems and storage deliver the power that they deliver in the OpenDSS engine."""

from pathlib import Path

import pytest

from plant.imports.opendss import read_opendss
from tests.unit.plant.imports.opendss.opendss_solutions import LINE, STEP_DOWN, TOLERANCE, largest_difference, write

pytest.importorskip("dss", reason="the import of .dss files needs the extra opendss")

UNEVEN = "New Load.uneven bus1=c.1.2 phases=1 kv=0.48 kw=60 kvar=10 vminpu=0.5"
"""A load that makes the voltages unequal."""

SCRIPTS = {
    "generator": "New Generator.g bus1=c kv=0.48 kw=50 kvar=10",
    "one phase": "New Generator.g bus1=c.1 phases=1 kv=0.277 kw=20 pf=0.9",
    "two phases": "New Generator.g bus1=c.2.3 phases=2 kv=0.48 kw=30 pf=0.9",
    "delta": "New Generator.g bus1=c conn=delta kv=0.48 kw=50 pf=-0.9",
    "below its limits": "New Generator.g bus1=c kv=0.48 kw=50 pf=-0.9 vminpu=1.1 vmaxpu=1.2",
    "partly above its limits": "New Generator.g bus1=c kv=0.48 kw=50 vminpu=0.7 vmaxpu=0.99",
    "impedance": "New Generator.g bus1=c kv=0.48 kw=50 model=2",
    "voltage-controlled": "New Generator.g bus1=c kv=0.48 kw=50 model=3 maxkvar=40 minkvar=-40 vpu=1.0",
    "photovoltaic": "New PVSystem.p bus1=c.1.2 phases=1 kv=0.48 kva=50 pmpp=40 irradiance=0.8",
    "volt-var": (
        "New PVSystem.p bus1=c kv=0.48 kva=50 pmpp=40\n"
        "New XYcurve.vv npts=4 Yarray=(1 1 -1 -1) XArray=(0.5 0.95 1.05 1.5)\n"
        "New InvControl.i mode=voltvar voltage_curvex_ref=rated vvc_curve1=vv derlist=(pvsystem.p)"
    ),
    "discharging": "New Storage.s bus1=c kv=0.48 kwrated=50 kwhrated=100 state=discharging",
    "charging": "New Storage.s bus1=c kv=0.48 kwrated=50 kwhrated=100 state=charging %stored=20",
}


@pytest.mark.parametrize("kind", SCRIPTS)
def test_generation_delivers_what_the_engine_says(tmp_path: Path, kind: str) -> None:
    """Generation of each class, connection and range of voltage agrees with the engine."""
    assert largest_difference(write(tmp_path, LINE, STEP_DOWN, UNEVEN, SCRIPTS[kind])) < TOLERANCE


def test_generation_is_told_and_no_load(tmp_path: Path) -> None:
    """A note says how much an element delivers; it counts as generation, and one that delivers nothing is left out."""
    idle = "New Generator.idle bus1=c kv=0.48 kw=0 kvar=0"
    feeder = read_opendss(write(tmp_path, LINE, STEP_DOWN, UNEVEN, SCRIPTS["generator"], idle))

    assert feeder.notes == (
        "generator.g: delivers the 50 kW and 10 kvar of the snapshot, constant",
        "generator.idle: delivers nothing; left out",
    )
    assert feeder.generation_by_bus() == {"c": pytest.approx(50e3)}
    assert feeder.load_by_bus() == {"c": pytest.approx(60e3)}
