"""The paper's law with the gains of a scenario under its `[degraded_communication]`. Pure."""

from __future__ import annotations

import msgspec

from gridpeers.agents.agent_config import Control
from gridpeers.agents.degraded_communication import gains_in_force
from gridpeers.agents.laws.consensus import Consensus


def law_in_force(control: Control) -> Consensus:
    """Return the paper's law for one inverter.

    Examples
    --------
    >>> law_in_force(Control(secondary="all", graph="full")).k_p
    0.0007
    """
    gains = gains_in_force(control.gains, control.degraded_communication)
    kappa_c = (
        control.degraded_communication.kappa_c if control.degraded_communication.weights == "degree-normalised" else 0.0
    )
    return Consensus(**msgspec.structs.asdict(gains), kappa_c=kappa_c)
