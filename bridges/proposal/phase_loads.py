"""What an island takes of each phase: inverters must carry the heaviest one, and the charging of its cables."""

from __future__ import annotations

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from gridpeers.plant.equipment import PHASES, Feeder
from gridpeers.plant.network import Network
from gridpeers.plant.network.powerflow import solve_power_flow


def phase_powers(feeder: Feeder, switch: str, head: str) -> NDArray[np.complex128]:
    """Return the power (VA) through a switch of each phase of its far side, while the substation feeds everything.

    It is without fixed generation. So loads between phases, behind transformers and on split-phase services count where
    they come from.

    Parameters
    ----------
    feeder
        The feeder; its power flow has a solution, else the result is empty.
    switch
        Name or alias of the closed switch.
    head
        Its bus away from the substation.
    """
    loads = tuple(part for part in feeder.load_parts if part.S.real >= 0.0)
    network = Network(replace(feeder, load_parts=loads, inverters=()))
    try:
        V = solve_power_flow(network, network.closed0).V
    except ArithmeticError:
        return np.empty(0, np.complex128)
    without = network.closed0 - {network.switch_name(switch)}
    merge = network.merge(without)
    through = network.admittance(without) @ V + merge.gather(network.loads().currents(V))
    at = [int(merge.representative[network.index(head, phase)]) for phase in PHASES if network.has(head, phase)]
    S: NDArray[np.complex128] = V[at] * through[at].conj()
    return S


def heaviest_phase(S: NDArray[np.complex128]) -> float:
    """Return the load of the heaviest phase in relation to the mean of all, from the power (VA) of each; 1 of none."""
    P = S.real
    return float(3.0 * P.max() / P.sum()) if P.sum() > 0.0 else 1.0
