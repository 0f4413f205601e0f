"""Loads of every model, connection and number of phases draw what the OpenDSS engine has them draw."""

from pathlib import Path

import numpy as np
import pytest

from gridpeers.bridges.opendss import read_opendss
from gridpeers.plant.network import Network, solve_power_flow
from tests.unit.bridges.opendss.opendss_scripts import LOAD_SCRIPTS, RANGES
from tests.unit.bridges.opendss.opendss_solutions import LINE, STEP_DOWN, TOLERANCE, largest_difference, write

pytest.importorskip("dss", reason="the import of .dss files needs the extra opendss")


@pytest.mark.parametrize("loads", LOAD_SCRIPTS)
def test_loads_draw_what_the_engine_says(tmp_path: Path, loads: str) -> None:
    """Loads of each model, within, above and below their limits, and of each connection, agree with the engine."""
    assert largest_difference(write(tmp_path, LINE, STEP_DOWN, LOAD_SCRIPTS[loads])) < TOLERANCE


def test_a_load_uses_its_neutral_node(tmp_path: Path) -> None:
    """A wye load whose neutral is a node of the bus returns its current through that node's grounding."""
    grounding = "New Reactor.ground bus1=c.4 bus2=c.0 phases=1 r=0.05 x=0.02"
    load = "New Load.l bus1=c.1.2.3.4 phases=3 kv=0.48 kw=120 kvar=20 vminpu=0.7"
    uneven = "New Load.one bus1=c.1.4 phases=1 kv=0.277 kw=50 kvar=5 model=5 vminpu=0.7"

    assert largest_difference(write(tmp_path, LINE, STEP_DOWN, grounding, load, uneven)) < TOLERANCE


def test_the_load_multiplier_scales_variable_loads_alone(tmp_path: Path) -> None:
    """`set loadmult` scales neither fixed and exempt loads nor the reactive power of models 6 and 7."""
    loads = [
        f"New Load.l{k} bus1=c phases=3 kv=0.48 kw=50 kvar=20 status={status} vminpu=0.8"
        for k, status in enumerate(("variable", "fixed", "exempt", "variable model=6", "variable model=7"))
    ]

    assert largest_difference(write(tmp_path, LINE, STEP_DOWN, *loads, "Set LoadMult=0.4")) < TOLERANCE


@pytest.mark.parametrize(("cut_off", "part"), [(0.98, 1.0), (1.0195, 0.5), (1.05, 0.0), (1.3, 0.0)])
def test_a_zip_load_drops_out_at_its_cut_off_voltage(tmp_path: Path, cut_off: float, part: float) -> None:
    """A ZIP load is off below its cut-off voltage, on above it, and partly on close to it."""
    load = f"New Load.l bus1=c phases=3 kv=0.48 kw=9 kvar=3 model=8 zipv=(0.3 0.5 0.2 0.1 0.6 0.3 {cut_off})"
    path = write(tmp_path, LINE, STEP_DOWN, load)
    network = Network(read_opendss(path))
    V = solve_power_flow(network, network.closed0)
    taken = (network.loads().powers(V).sum() + V @ np.conj(network.Y_loads @ V)).real

    assert taken == pytest.approx(part * 9.3e3, abs=2.5e3)
    assert largest_difference(path) < TOLERANCE


def test_a_difference_from_the_engine_is_told(tmp_path: Path) -> None:
    """Model 7 jumps at vlowpu in the engine, and not here: a note says by how much, and where."""
    load = f"New Load.l bus1=c phases=3 kv=0.48 kw=150 kvar=60 model=7 {RANGES['far below its limit']}"

    (note,) = read_opendss(write(tmp_path, LINE, STEP_DOWN, load)).notes

    assert note.startswith("bus c: our power flow differs from the engine's by 0.0")


def test_the_admittance_model_of_loads_is_an_impedance(tmp_path: Path) -> None:
    """`set loadmodel=admittance` makes an impedance of every load, of whatever model, in the engine and in ours."""
    load = "New Load.l bus1=c phases=3 kv=0.48 kw=150 kvar=60 model=1"

    assert largest_difference(write(tmp_path, LINE, STEP_DOWN, load, "Set LoadModel=Admittance")) < TOLERANCE


def test_loads_may_generate_and_take_reactive_power_alone(tmp_path: Path) -> None:
    """Loads of negative power, and without active power, are in the engine's power flow and in ours."""
    loads = """New Load.l bus1=c phases=3 kv=0.48 kw=-90 kvar=30
New Load.z bus1=c.1 phases=1 kv=0.277 kw=20 pf=-0.9 model=2
New Load.q bus1=c phases=3 kv=0.48 kw=0 kvar=60"""

    assert largest_difference(write(tmp_path, LINE, STEP_DOWN, loads)) < TOLERANCE
