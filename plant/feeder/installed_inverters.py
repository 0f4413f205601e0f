"""The inverters of a network as the plant's dynamics have them."""

from __future__ import annotations

from gridpeers.plant.dynamics import Inverter
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import PlantSettings


def installed_inverters(network: Network, settings: PlantSettings) -> tuple[Inverter, ...]:
    """Return all inverters of a network, spare ones too, in its order, with the parameters of each."""
    feeder = network.feeder
    return tuple(
        Inverter(
            name=unit.name,
            kind=unit.kind,
            phases=unit.phases,
            S_b=unit.P_rated,
            V_b=unit.V_nom,
            m_p=unit.m_p,
            m_q=unit.m_q,
            parameters=feeder.parameters_of(unit, settings.gfm, settings.gfl),
            f_nom=feeder.f_nom,
        )
        for unit in network.inverters
    )
