"""The power flow of the nodes that the substation feeds, without inverters."""

from __future__ import annotations

import numpy as np

from gridpeers.plant.dynamics.circuit import Circuit, NoPowerFlowError
from gridpeers.plant.dynamics.inverters import Inverters
from gridpeers.plant.dynamics.kernel.compiled import Complex
from gridpeers.plant.dynamics.power_flow_at_rest import InverterPowerFlow
from gridpeers.plant.network.network import Network


def solve_power_flow(network: Network, closed: frozenset[str]) -> Complex:
    """Return the voltages of all nodes (V, line-to-ground), 0 where the substation does not reach.

    ValueError if the feeder has no source; ArithmeticError if the network cannot carry the loads.
    """
    if not len(network.source_nodes):
        raise ValueError(f'feeder "{network.feeder.name}" has no source; a power flow needs one, give source.csv')
    merge = network.merge(closed)
    loads = network.loads().on(merge)
    circuit = Circuit(
        Y=network.admittance(closed),
        sources=network.source_nodes,
        source_voltage=network.source_voltage,
        terminals=np.zeros((0, 3), np.int64),
        C=loads.incidence(len(network.nodes)),
        loads=loads.law,
        V_branch=loads.V_nom * np.exp(1j * loads.phi0),
    )
    none, of_none, J = np.zeros(0), np.zeros(0, bool), np.zeros((0, 3), complex)
    flow = InverterPowerFlow(circuit, Inverters(()), of_none)
    try:
        flow.solve(J, none, none, of_none)
    except NoPowerFlowError as error:
        raise ArithmeticError(f"power flow has no solution; {network.weak_loads(error.weak)}") from None
    return merge.expand(flow.reduction.all_voltages(J, flow.I_b, circuit.source_voltage))
