"""The feeder of a scenario that changes the data of another one. Pure."""

from __future__ import annotations

from msgspec.structs import replace

from gridpeers.plant.equipment import InverterRow, Tables
from gridpeers.plant.plant_config import FeederChanges, InverterChange


def changed(feeder: Tables, changes: FeederChanges) -> Tables:
    """Return the feeder with changes applied; without any it is the same object.

    At another nominal frequency the equipment stays and its reactances change: those of lines and transformers, the
    lines' susceptances, and the capacitors' reactive power go with the frequency. Loads are powers at nominal
    frequency, and inverters' filters per-unit values at nominal frequency; both stay as they are.
    """
    if changes == FeederChanges():
        return feeder
    feeder = _at_frequency(feeder, feeder.f_nom if changes.f_nom is None else changes.f_nom)
    if changes.load_factor != 1.0:
        k = changes.load_factor
        loads = tuple(replace(load, S=(k * load.S[0], k * load.S[1], k * load.S[2])) for load in feeder.loads)
        parts = tuple(replace(part, S=k * part.S) for part in feeder.load_parts)
        feeder = replace(feeder, loads=loads, load_parts=parts)
    return replace(
        feeder,
        inverters=tuple(_inverter(row, changes) for row in feeder.inverters),
        spares=tuple(_inverter(row, changes) for row in feeder.spares),
    )


def _inverter(row: InverterRow, changes: FeederChanges) -> InverterRow:
    change = changes.inverters.get(row.name, InverterChange())
    values = {"m_p": row.m_p * changes.m_p_factor, "m_q": row.m_q * changes.m_q_factor, "own": change.own}
    given = {name: getattr(change, name) for name in ("m_p", "m_q", "P_rated", "parameters")}
    return replace(row, **values | {name: value for name, value in given.items() if value is not None})


def _at_frequency(feeder: Tables, f_nom: float) -> Tables:
    if f_nom == feeder.f_nom:
        return feeder
    k = f_nom / feeder.f_nom
    return replace(
        feeder,
        f_nom=f_nom,
        line_configs=tuple(
            replace(
                config,
                Z=tuple(tuple(complex(z.real, k * z.imag) for z in row) for row in config.Z),
                B=tuple(tuple(k * b for b in row) for row in config.B),
            )
            for config in feeder.line_configs
        ),
        transformers=tuple(replace(it, z=complex(it.z.real, k * it.z.imag)) for it in feeder.transformers),
        capacitors=tuple(replace(it, Q=(k * it.Q[0], k * it.Q[1], k * it.Q[2])) for it in feeder.capacitors),
    )
