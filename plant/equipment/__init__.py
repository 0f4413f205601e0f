"""What a feeder consists of: the rows of its tables, the parameters of its inverters, and which nodes they connect."""

from plant.equipment.equipment import (
    F_NOM,
    NODES,
    PHASES,
    Bus,
    Capacitor,
    Feeder,
    InverterRow,
    Line,
    LineConfig,
    Load,
    Phase,
    Regulator,
    Source,
    Switch,
    Transformer,
)

__all__ = [
    "F_NOM",
    "NODES",
    "PHASES",
    "Bus",
    "Capacitor",
    "Feeder",
    "InverterRow",
    "Line",
    "LineConfig",
    "Load",
    "Phase",
    "Regulator",
    "Source",
    "Switch",
    "Transformer",
]
