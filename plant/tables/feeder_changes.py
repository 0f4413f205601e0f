"""A feeder with other data than its tables have: nominal frequency, loads, droops and ratings. Pure."""

from __future__ import annotations

from msgspec.structs import replace

from gridpeers.plant.equipment import Feeder, InverterRow
from gridpeers.plant.equipment.own_parameters import OwnParameters
from gridpeers.plant.plant_config import FeederChanges


def changed(feeder: Feeder, changes: FeederChanges) -> Feeder:
    """Return the feeder with changes applied; without any it is the same object.

    At another nominal frequency the equipment stays and its reactances change: those of lines and transformers, the
    lines' susceptances, and the capacitors' reactive power go with the frequency. Loads are powers at nominal
    frequency, and inverters' filters per-unit values at nominal frequency; both stay as they are.

    Parameters
    ----------
    feeder : Feeder
        As its tables have it.
    changes : FeederChanges
        What is to be otherwise; inverters that there are not are left out.

    Examples
    --------
    >>> from gridpeers.plant.tables import read_feeder
    >>> feeder = read_feeder("microgrid123")
    >>> slower = changed(feeder, FeederChanges(f_nom=50.0, m_p_factor=2.0))
    >>> slower.f_nom, slower.inverters[0].m_p, round(slower.transformers[0].z.imag / feeder.transformers[0].z.imag, 6)
    (50.0, 0.02, 0.833333)
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
    """Return an inverter with its changes: its own values replace the table's, factors multiply the others."""
    own = changes.inverters.get(row.name)
    return replace(
        row,
        m_p=row.m_p * changes.m_p_factor if own is None or own.m_p is None else own.m_p,
        m_q=row.m_q * changes.m_q_factor if own is None or own.m_q is None else own.m_q,
        P_rated=row.P_rated if own is None or own.P_rated is None else own.P_rated,
        parameters=row.parameters if own is None or own.parameters is None else own.parameters,
        own=OwnParameters() if own is None else own.own,
    )


def _at_frequency(feeder: Feeder, f_nom: float) -> Feeder:
    """The same equipment at another nominal frequency (Hz)."""
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
