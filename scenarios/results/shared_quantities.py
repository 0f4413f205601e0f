"""What laws share beside the paper's values, such as an integral Omega, as quantities of a record: read and plotted.

A law declares them (docs/laws.md); the values stand in the states that its agents sent, whose time is that of the
measurement: in simulated time all agents' are the same.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from gridpeers.agents.agent_config import SharedQuantity
from gridpeers.scenarios.record.record_file import RecordFileError
from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.scenarios.results.case_tables import QUANTITIES
from gridpeers.scenarios.results.history import Floats
from gridpeers.scenarios.schema.plugin_keys import law_of
from gridpeers.wire.messages import State
from gridpeers.wire.wording import suggestion

if TYPE_CHECKING:
    import pandas as pd

    from gridpeers.scenarios.checks.checked_case import CheckedCase

Series = Mapping[str, tuple[Floats, Floats]]
"""Times (s) and values of one quantity, by inverter."""


class SharedRecord(NamedTuple):
    """A shared quantity in the cases of a run."""

    quantity: SharedQuantity
    series: Mapping[str, Series]
    """By case."""


def read_shared(record: RunRecord) -> dict[str, Series]:
    """Return all that the laws of a run shared, by name; RecordFileError if the record has no states."""
    if record.info.level == "physics":
        raise RecordFileError(f'{record.path}: it has no states: the run was recorded with record = "physics"')
    found: dict[str, dict[str, list[tuple[float, float]]]] = {}
    for state in record.messages(State):
        for name, value in state.shared.items():
            found.setdefault(name, {}).setdefault(state.sender, []).append((state.t, value))
    inverters = record.agents
    return {name: {it: _columns(of[it]) for it in inverters if it in of} for name, of in found.items()}


def _columns(rows: list[tuple[float, float]]) -> tuple[Floats, Floats]:
    t, values = np.array(rows).T
    return t, values


def shared_frame(record: RunRecord, name: str) -> pd.DataFrame:
    """Return one quantity: a column for each inverter, index t (s), unit in `attrs`; nan where an agent sent none.

    Raise RecordFileError if no law shared it.
    """
    shared = read_shared(record)
    if name not in shared:
        of_plant = [column.rpartition("_")[0] for column in QUANTITIES]
        known = suggestion(name, (*of_plant, *shared), "quantities") + ("" if shared else "; no law shared anything")
        raise RecordFileError(f'{record.path}: there is no quantity "{name}"; {known}')
    frame = _frame(shared[name])
    frame.index.name, frame.columns.name = "t", "inverter"
    frame.attrs["units"] = {"t": "s", name: _units(record).get(name, "")}
    return frame


def shared_table(record: RunRecord) -> pd.DataFrame:
    """Return what laws shared as a table for other programs: a column t_s, and e.g. inv1_Omega_pu.

    It is empty if the law declares nothing, or the record has no states: no message is read then.
    """
    import pandas as pd

    if not (units := _units(record)) or record.info.level == "physics":
        return pd.DataFrame()
    frames = [
        _frame(series).add_suffix(f"_{name}_{units[name]}" if units.get(name) else f"_{name}")
        for name, series in read_shared(record).items()
    ]
    return pd.concat(frames, axis=1).sort_index().rename_axis("t_s").reset_index() if frames else pd.DataFrame()


def _frame(series: Series) -> pd.DataFrame:
    import pandas as pd  # takes longer to import than a case to run

    columns = {it: pd.Series(values, index=t) for it, (t, values) in series.items()}
    return pd.DataFrame({it: column[~column.index.duplicated(keep="last")] for it, column in columns.items()})


def _units(record: RunRecord) -> dict[str, str]:
    return {it.name: it.unit for agent in record.info.agents[:1] for it in agent.control.law.shared}


def shared_records(cases: Mapping[str, CheckedCase]) -> dict[str, SharedRecord]:
    """Return what the laws of a run declare to share, by name, in the cases that were recorded."""
    found: dict[str, SharedRecord] = {}
    for name, case in cases.items():
        if not (declared := law_of(case.scenario, name).shared) or case.folder is None:
            continue
        try:
            shared = read_shared(RunRecord.open(case.folder))
        except RecordFileError:
            continue
        for quantity in declared:
            if quantity.name in shared:
                of = found.setdefault(quantity.name, SharedRecord(quantity, {}))
                found[quantity.name] = of._replace(series={**of.series, name: shared[quantity.name]})
    return found
