"""An FMU that fails as its parameter says: the source that pythonfmu exports. It imports nothing of gridpeers."""

import os

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real


class FailingFmu(Fmi2Slave):
    """Holds P_set = 0.5 pu; `how` 1 hangs, 2 gives nan, 3 raises, 4 ends its process, 5 prints."""

    def __init__(self, **arguments):
        super().__init__(**arguments)
        self.P_set, self.V_set, self.how = 0.5, 1.0, 0.0
        for name in ("P_set", "V_set"):
            self.register_variable(Real(name, causality=Fmi2Causality.output))
        self.register_variable(
            Real("how", causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable, start=0.0)
        )

    def do_step(self, current_time, step_size):
        while self.how == 1.0:
            pass
        if self.how == 2.0:
            self.P_set = float("nan")
        if self.how == 3.0:
            raise RuntimeError("no idea")
        if self.how == 4.0:
            os.abort()
        if self.how == 5.0:
            os.write(1, b"hello\n")
        return True
