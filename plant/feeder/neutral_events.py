"""Events of neutrals: inverters that begin to earth theirs, and neutrals that stand off earth."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from gridpeers.plant.dynamics import Dynamics
from gridpeers.plant.equipment.imported_equipment import is_behind
from gridpeers.plant.network import Network
from gridpeers.wire.messages import PlantEvent
from gridpeers.wire.wording import counted

TOUCHABLE = 50.0
"""Voltage to earth (V) that may last on what people touch (IEC 60364-4-41)."""


class NeutralEvents:
    """Report the neutrals of a feeder when its network has changed; each once, until it is as before.

    Parameters
    ----------
    network
        The feeder's network.
    """

    def __init__(self, network: Network) -> None:
        self._network = network
        self._all = np.array([network.index(*node) for node in network.neutrals.items()], np.int64)
        self._neutrals = [node for node in network.neutrals.items() if not is_behind(node[0])]
        self._nodes = np.array([network.index(*node) for node in self._neutrals], np.int64)
        self._earthing: set[int] = set()
        self._tied: set[int] = set()
        self._off: set[int] = set()

    def report(self, t: float, closed: frozenset[str], dynamics: Dynamics) -> list[PlantEvent]:
        """Return the events at t (s), with these switches closed."""
        if not self._neutrals:
            return []
        earthing = set(dynamics.network.reduction.earthing)
        rows = [self._network.inverters[i] for i in sorted(earthing - self._earthing)]
        self._earthing = earthing
        events = [
            PlantEvent(
                t=t,
                kind="island",
                subject=row.name,
                text=f"{row.name} earths its neutral, node {row.neutral} of bus {row.bus}: nothing else does",
            )
            for row in rows
        ]
        tied = set(self._tied_alone(closed, dynamics))
        rows = [self._network.inverters[i] for i in sorted(tied - self._tied)]
        self._tied = tied
        events += [
            PlantEvent(
                t=t,
                kind="warning",
                subject=row.name,
                text=f"{row.name}: the neutral alone ties its part to the grid, so it counts as fed by the grid; let "
                "the switch open the neutral, too",
            )
            for row in rows
        ]
        V = np.abs(self._network.merge(closed).expand(dynamics.voltages())[self._nodes])
        off = set(np.flatnonzero(V > TOUCHABLE).tolist())
        new, self._off = off - self._off, off
        if new:
            worst = max(new, key=lambda k: V[k])
            bus, letter = self._neutrals[worst]
            others = f" (and of {counted(len(new) - 1, 'bus', 'buses')} more)" if len(new) > 1 else ""
            text = (
                f"the neutral of bus {bus}{others}, node {letter}, has {V[worst]:.0f} V to earth, more than the "
                f"{TOUCHABLE:.0f} V that may last: nothing earths it well enough; let the grid-forming inverter return "
                "to it, or earth it"
            )
            events.append(PlantEvent(t=t, kind="warning", subject=bus, text=text))
        return events

    def _tied_alone(self, closed: frozenset[str], dynamics: Dynamics) -> list[int]:
        """Return the grid-forming inverters that nothing but a neutral connects with the substation."""
        network, reduction = self._network, dynamics.network.reduction
        forming = np.flatnonzero(dynamics.inverters.forming & reduction.online)
        forming = forming[reduction.has_source[reduction.inverter_island[forming]]]
        if not forming.size:
            return []
        merge = network.merge(closed)
        keep = np.ones(len(network.nodes))
        keep[merge.representative[self._all]] = 0.0
        phases = sp.diags_array(keep)
        _, label = connected_components(phases @ abs(network.admittance(closed)) @ phases, directed=False)
        first = [merge.representative[network.index(*network.inverters[i].node)] for i in forming.tolist()]
        alone = ~np.isin(label[first], label[network.source_nodes])
        return [int(i) for i in forming[alone]]
