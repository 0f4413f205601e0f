"""Kirchhoff's current law in what the inner loop solves, on feeders whose couplings are not mutual."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from bench.validation.kirchhoff import kirchhoff_residual
from gridpeers.bridges.opendss import read_opendss
from gridpeers.plant.dynamics import Dynamics
from gridpeers.plant.equipment import InverterRow, Line, LineConfig, Load, Source, Switch, Tables, Transformer
from gridpeers.plant.feeder.circuits import circuit_of
from gridpeers.plant.feeder.plant import installed_inverters
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import PlantSettings
from tests.unit.plant import networks

LARGEST = 1e-6
"""Current (A) that may be left at a node."""

SCRIPT = """Clear
New Circuit.test bus1=s basekv=12.47 pu=1.02 z1=[0.1 0.5] z2=[0.3 0.8] z0=[0.2 0.9]
New LineCode.uneven nphases=3 units=km rmatrix=(0.3 | 0.1 0.3 | 0.1 0.1 0.3) xmatrix=(0.9 | 0.4 0.8 | 0.3 0.3 0.9)
~ cmatrix=(17 | -5 16 | -3 -2 15)
New Reactor.head bus1=s bus2=b0 phases=3 z1=[0.2 0.9] z2=[0.4 0.6] z0=[0.5 1.9]
New Line.out bus1=b0 bus2=b1 linecode=uneven length=0.8
{lines}
New Transformer.t phases=3 xhl=4 buses=(b3 low) conns=(wye wye) kvs=(12.47 0.4) kvas=(500 500)
New Reactor.low bus1=low bus2=lower phases=3 z1=[0.002 0.009] z2=[0.004 0.006] z0=[0.005 0.019]
New Load.low bus1=lower phases=3 kv=0.4 kw=90 kvar=20
Set VoltageBases=(12.47 0.4)
CalcVoltageBases
Solve
"""
"""Rotating machines and their like have another impedance of negative than of positive sequence: z12 is not z21."""


def asymmetric(folder: Path) -> Tables:
    """Import a feeder with such elements, and three inverters."""
    lines = "".join(
        f"New {'Reactor' if k % 2 else 'Line'}.l{k} bus1=b{k} bus2=b{k + 1} "
        + ("phases=3 z1=[0.2 0.9] z2=[0.4 0.6] z0=[0.5 1.9]\n" if k % 2 else "linecode=uneven length=0.4\n")
        + f"New Load.a{k} bus1=b{k + 1}.1 phases=1 kv=7.2 kw={20 + k} kvar=8\n"
        + f"New Load.bc{k} bus1=b{k + 1}.2.3 phases=1 conn=delta kv=12.47 kw={10 + k} kvar=4\n"
        for k in range(1, 9)
    )
    script = folder / "asymmetric.dss"
    script.write_text(SCRIPT.format(lines=lines))
    feeder = read_opendss(script, switches=["line.out"])
    units = [("GFM", "b2", 7200.0), ("GFM", "b7", 7200.0), ("GFL", "lower", 230.94)]
    rows = [
        InverterRow(name=f"inv{i}", kind=kind, bus=bus, microgrid="1", P_rated=4e5, V_nom=V, m_p=0.01, m_q=0.05)  # type: ignore[arg-type]
        for i, (kind, bus, V) in enumerate(units)
    ]
    return replace(feeder, inverters=tuple(rows))


def test_currents_balance_where_couplings_are_not_mutual(tmp_path: Path) -> None:
    """At every node of an imported feeder with z12 unlike z21: at the start, after islanding, and after 0.1 s."""
    network = Network(asymmetric(tmp_path))
    Y = network.admittance(network.closed0)
    assert abs(Y - Y.T).max() > 0.01, "the network is symmetric, so nothing is tested"
    loads = network.loads()
    dynamics = Dynamics(
        circuit_of(network, network.closed0, loads), installed_inverters(network, PlantSettings()), 0.002
    )

    dynamics.start(np.full(3, 0.3), V_set=np.full(3, 1.0))
    assert kirchhoff_residual(dynamics) < LARGEST

    dynamics.connect(circuit_of(network, frozenset(), loads))
    assert kirchhoff_residual(dynamics) < LARGEST
    assert dynamics.take_trips() == []

    dynamics.run(50)
    assert kirchhoff_residual(dynamics) < LARGEST


def with_open_ends(seed: int) -> Tables:
    """Make a feeder with lines without charging whose far ends are open, behind a wye-wye transformer.

    Seen from their near end they are nothing: the couplings of the phases there cancel, exactly or nearly. Every second
    seed has z12 unlike z21.
    """
    rng = np.random.default_rng(seed)
    z = np.full((3, 3), 0.2j) + np.diag(rng.uniform(0.3, 1.0, 3).round(2)) * (1.0 + 2.0j)
    if seed % 2:
        z += np.triu(rng.uniform(0.0, 0.1, (3, 3)).round(2), 1) * (1.0 + 1.0j)
    Z = tuple(tuple(map(complex, row)) for row in z)
    config = LineConfig(name="c", phases="ABC", Z=Z, B=networks.diagonal(0.0))
    ends = (("s", "a"), ("x", "y"), ("y", "z"))
    behind = (("b", "x"), ("x", "c"), ("c", "d"))
    return networks.feeder(
        buses=tuple(networks.three_phase_bus(name) for name in "sabcdxyz"),
        lines=tuple(Line(name=f"{i}{j}", from_bus=i, to_bus=j, phases="ABC", config="c", length=0.4) for i, j in ends),
        line_configs=(config,),
        switches=(Switch(name="a-b", alias="", from_bus="a", to_bus="b", phases="ABC", closed=True),),
        transformers=tuple(
            Transformer(name=i + j, from_bus=i, to_bus=j, connection="Yg-Yg", S_rated=1e5, z=0.01 + 0.04j)
            for i, j in behind
        ),
        loads=(
            Load(bus="x", connection="Y", model="P", S=(9e3, 8e3, 5e3)),
            Load(bus="d", connection="Y", model="P", S=(4e3 + 1e3j,) * 3),
        ),
        inverters=(
            InverterRow(name="inv1", kind="GFM", bus="c", microgrid="1", P_rated=6e4, V_nom=2400.0, m_p=0.01, m_q=0.05),
        ),
        source=Source(bus="s", V_pu=1.0, angle=0.0),
    )


@pytest.mark.parametrize("seed", range(6))
def test_currents_balance_where_terms_of_the_network_cancel(seed: int) -> None:
    """At the start and after islanding, with unloaded line ends behind a wye-wye transformer."""
    network = Network(with_open_ends(seed))
    loads, units = network.loads(), installed_inverters(network, PlantSettings())
    dynamics = Dynamics(circuit_of(network, network.closed0, loads), units, 0.002)

    dynamics.start(np.full(1, 0.3), V_set=np.full(1, 1.0))
    assert kirchhoff_residual(dynamics) < LARGEST

    dynamics.connect(circuit_of(network, frozenset(), loads))
    assert kirchhoff_residual(dynamics) < LARGEST
    assert dynamics.take_trips() == []
