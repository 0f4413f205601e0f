"""A control law of my own."""

from typing import Annotated

import gridpeers as gp


class Mine(gp.Law):
    """Go to the neighbours' mean set-point and vars; leaders also take away the frequency error."""

    share: Annotated[float, gp.Unit("1/s"), gp.Range(0, 100), "Rate of going to the neighbours' mean."] = 10.0
    restore: Annotated[float, gp.Unit("1/s"), gp.Range(0, 100), "Rate of taking away the frequency error."] = 10.0

    def step(self, own, neighbours, T):
        """Decide the set-points of the next control period; everything is in per unit."""
        P_set, V_set = own.P_set, own.V_set
        if neighbours:
            mean = sum(neighbour.P_set for neighbour in neighbours) / len(neighbours)
            P_set += min(0.5, self.share * T) * (mean - own.P_set)
            mean = sum(neighbour.Q for neighbour in neighbours) / len(neighbours)
            V_set += min(0.5, self.share * T) * own.m_q * (mean - own.Q)  # droop: V changes by m_q for each unit of Q
        if own.leader:  # droop: f changes by m_p for each unit of P_set
            P_set -= min(0.5, self.restore * T) * own.e / own.m_p
        return gp.SetPoints(P_set=P_set, V_set=V_set)
