"""How unequally the phases of an island are loaded: inverters must carry the heaviest one."""

from __future__ import annotations

from msgspec.structs import replace

from plant.equipment import PHASES, Feeder
from plant.network import Network
from plant.network.powerflow import solve_power_flow


def heaviest_phase(feeder: Feeder, switch: str, head: str) -> float:
    """Return the load of the heaviest phase beyond a switch, in relation to the mean of the three phases.

    It is the power through the switch while the substation feeds everything, without fixed generation. So loads
    between phases, behind transformers and on split-phase services count where they come from.

    Parameters
    ----------
    feeder
        The feeder; its power flow has a solution, else the result is 1.
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
        return 1.0
    without = network.closed0 - {network.switch_name(switch)}
    merge = network.merge(without)
    through = network.admittance(without) @ V + merge.gather(network.loads().currents(V))
    at = [int(merge.representative[network.index(head, phase)]) for phase in PHASES if network.has(head, phase)]
    P = (V[at] * through[at].conj()).real
    return float(3.0 * P.max() / P.sum()) if P.sum() > 0.0 else 1.0
