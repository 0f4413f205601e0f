"""The paper's law as an FMU: the source that pythonfmu exports. It imports nothing of gridpeers."""

from math import exp

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real

OWN = ("leader", "e", "z", "V", "P_set", "V_set", "m_p")
OTHER = ("weight", "P_set", "Q", "m_p", "m_q")


class ConsensusFmu(Fmi2Slave):
    """Equations (12)-(15) for up to 16 neighbours, with the paper's gains."""

    def __init__(self, **arguments):
        super().__init__(**arguments)
        names = ["T", "neighbours", *(f"own_{name}" for name in OWN)]
        names += [f"neighbour_{i}_{name}" for i in range(1, 17) for name in OTHER]
        for name in names:
            self._declare(name, 0.0, Fmi2Causality.input, Fmi2Variability.continuous)
        for name, value in {"k_p": 0.0007, "k_q": 0.25}.items():
            self._declare(name, value, Fmi2Causality.parameter, Fmi2Variability.tunable)
        for name in ("P_set", "V_set"):
            self._declare(name, 0.0, Fmi2Causality.output, Fmi2Variability.continuous)

    def _declare(self, name, value, causality, variability):
        setattr(self, name, value)
        self.register_variable(Real(name, causality=causality, variability=variability))

    def do_step(self, current_time, step_size):
        y = z = d = 0.0
        for i in range(1, int(self.neighbours) + 1):
            weight, P_set, Q, m_p, m_q = (getattr(self, f"neighbour_{i}_{name}") for name in OTHER)
            y += weight * m_p * P_set
            z += weight * m_q * Q
            d += weight
        y, z = (y / d, z / d) if d > 0.0 else (0.0, 0.0)
        leader, T = self.own_leader > 0.5, self.T
        kappa, own_y = self.own_m_p / self.k_p, self.own_m_p * self.own_P_set
        change = 0.5 * (1.0 - exp(-2.0 * kappa * d * T)) * (y - own_y)
        if leader:
            change -= (1.0 - exp(-kappa * T)) * self.own_e
        self.P_set = min(max(self.own_P_set + change / self.own_m_p, 0.0), 1.0)
        alpha = 1.0 if leader else 0.0
        if alpha > 2.0 * d:
            b = 1.0 - exp(-alpha * T / self.k_q)
            a = b * d / alpha
        else:
            a = 0.5 * (1.0 - exp(-2.0 * (1.0 / self.k_q) * d * T))
            b = a * alpha / d if d > 0.0 else 0.0
        change = -a * (self.own_z - z)
        if leader:
            change -= b * (self.own_V - 1.0)
        self.V_set = min(max(self.own_V_set + change, 0.9), 1.1)
        return True
