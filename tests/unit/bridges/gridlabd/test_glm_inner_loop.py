"""What the inner loop solves of imported models: lines with z12 unlike z21, and lines of negative impedance."""

from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from bench.validation.kirchhoff import kirchhoff_residual, solved_voltages
from gridpeers.bridges.gridlabd.export_glm import export_glm
from gridpeers.bridges.gridlabd.read_glm import read_glm
from gridpeers.plant.dynamics import Dynamics
from gridpeers.plant.equipment import InverterRow
from gridpeers.plant.feeder.circuits import circuit_of
from gridpeers.plant.feeder.plant import installed_inverters
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import PlantSettings
from gridpeers.plant.tables import read_feeder
from tests.unit.bridges.gridlabd.glm_models import ASYMMETRIC, TOLERANCE, gridlabd_voltages, write

pytest.importorskip("gridlabd", reason="the import of .glm files needs the extra gridlabd")

PLACES = {"ring": ("GFM", 7200.0), "end": ("GFL", 7200.0), "c_low": ("GFL", 277.0)}
"""Inverters by their bus."""


def test_the_inner_loop_has_gridlabds_voltages_where_z12_is_not_z21(tmp_path: Path) -> None:
    """At the start and 20 ms after a switch opens, GridLAB-D given the inverters' powers as loads."""
    rows = [
        InverterRow(name=bus, kind=kind, bus=bus, microgrid="1", P_rated=2e5, V_nom=V, m_p=0.01, m_q=0.05)  # type: ignore[arg-type]
        for bus, (kind, V) in PLACES.items()
    ]
    network = Network(replace(read_glm(write(tmp_path, ASYMMETRIC)), inverters=tuple(rows)))
    loads, units = network.loads(), installed_inverters(network, PlantSettings())
    dynamics = Dynamics(circuit_of(network, network.closed0, loads), units, 0.002)
    dynamics.start(np.full(3, 0.3), V_set=np.full(3, 1.0))

    for status in ("CLOSED", "OPEN"):
        closed = network.closed0 if status == "CLOSED" else frozenset[str]()
        if status == "OPEN":
            dynamics.connect(circuit_of(network, closed, loads))
            dynamics.run(10)
        V, _ = solved_voltages(dynamics)
        at = dynamics.network.circuit.terminals
        S = V[at] * np.conj(dynamics.inverters.J - dynamics.inverters.y_f[:, None] * V[at])
        held = "".join(
            f"object load {{ parent {row.bus}; phases ABCN; nominal_voltage {row.V_nom}; "
            + "".join(f"constant_power_{p} {-s.real!r}{-s.imag:+.17g}j; " for p, s in zip("ABC", powers, strict=True))
            + "}\n"
            for row, powers in zip(rows, S.tolist(), strict=True)
        )
        theirs = gridlabd_voltages(write(tmp_path, ASYMMETRIC.replace("CLOSED", status) + held, "held.glm"))

        ours = dict(zip(network.nodes, network.merge(closed).expand(V) / network.V_nom, strict=True))
        V_nom = dict(zip(network.nodes, network.V_nom, strict=True))
        assert kirchhoff_residual(dynamics) < 1e-6
        gaps = {node: abs(ours[node] - theirs[node] / V_nom[node]) for node in theirs}
        assert len(gaps) == 21
        assert max(gaps.values()) < TOLERANCE, max(gaps, key=lambda node: gaps[node])


def test_a_node_between_an_impedance_and_its_negative_is_solved(tmp_path: Path) -> None:
    """Our own feeder as we write it for GridLAB-D has such nodes at its regulators: it starts, and is islanded."""
    own = read_feeder("microgrid123")
    path = write(tmp_path, export_glm(own, PlantSettings(), 1, "voltages.csv"))
    feeder = read_glm(path, leave_out=("inverter_dyn.*",))
    V_nom = {bus.name: bus.V_nom for bus in feeder.buses}
    rows = tuple(replace(row, bus=f"n{row.bus}", V_nom=V_nom[f"n{row.bus}"]) for row in own.inverters)
    network = Network(replace(feeder, inverters=rows))
    loads, n = network.loads(), len(rows)
    dynamics = Dynamics(
        circuit_of(network, network.closed0, loads), installed_inverters(network, PlantSettings()), 0.002
    )

    dynamics.start(np.full(n, 0.3), V_set=np.full(n, 1.0))
    assert kirchhoff_residual(dynamics) < 1e-6

    opened = {name for name in network.switches if "13-152" in name}
    dynamics.connect(circuit_of(network, network.closed0 - opened, loads))
    assert len(opened) == 1
    assert dynamics.take_trips() == []
    assert kirchhoff_residual(dynamics) < 1e-6
