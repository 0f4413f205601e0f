"""A feeder's equipment: rows of its tables, parameters of its inverters, and the nodes that they connect."""

from gridpeers.plant.equipment.equipment import (
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
