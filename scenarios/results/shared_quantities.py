"""Quantities that laws share beside the paper's values, such as an integral Omega: read from a record, and plotted.

A law declares them (docs/how-to/plug-ins.md). The values are in the states that its agents sent. The time of a state is
that of its measurement; in simulated time all agents have the same.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from typing import TYPE_CHECKING, NamedTuple

from gridpeers.agents.agent_config import SharedQuantity
from gridpeers.scenarios.record.record_file import RecordFileError
from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.scenarios.results.case_tables import QUANTITIES
from gridpeers.scenarios.schema.plugin_keys import law_of
from gridpeers.wire.messages import State
from gridpeers.wire.wording import suggestion

if TYPE_CHECKING:
    import pandas as pd

    from gridpeers.scenarios.checks.checked_case import CheckedCase


class SharedRecord(NamedTuple):
    quantity: SharedQuantity
    frames: Mapping[str, pd.DataFrame]
    """By case: a column for each inverter, index t (s)."""


def read_shared(record: RunRecord) -> pd.DataFrame:
    """Return all that the laws of a run shared: columns (quantity, inverter), index t (s); nan where none was sent.

    Raise RecordFileError if the record has no states.
    """
    import pandas as pd  # takes longer to import than a case to run

    if record.info.level == "physics":
        raise RecordFileError(f'{record.path}: it has no states: the run was recorded with record = "physics"')
    states = record.messages(kind=State)
    rows = [(state.t, name, state.sender, value) for state in states for name, value in state.shared.items()]
    places = ["t", "quantity", "inverter"]
    found = pd.DataFrame(rows, columns=[*places, "value"]).drop_duplicates(places, keep="last")
    frame = found.pivot(index="t", columns=places[1:], values="value")
    return frame.reindex(columns=record.agents, level="inverter")


def shared_frame(record: RunRecord, name: str) -> pd.DataFrame:
    """Return one quantity: a column for each inverter, index t (s), unit in `attrs`; nan where an agent sent none.

    Raise RecordFileError if no law shared it.
    """
    shared = read_shared(record)
    if name not in shared:
        known = [*(column.rpartition("_")[0] for column in QUANTITIES), *shared.columns.unique("quantity")]
        none = "; no law shared anything" if shared.empty else ""
        raise RecordFileError(
            f'{record.path}: there is no quantity "{name}"; {suggestion(name, known, "quantities")}{none}'
        )
    frame: pd.DataFrame = shared[name].dropna(how="all")
    frame.attrs["units"] = {"t": "s", name: _units(record).get(name, "")}
    return frame


def shared_table(record: RunRecord) -> pd.DataFrame:
    """Return what laws shared as a table for other programs: a column t_s, and e.g. inv1_Omega_pu.

    It is empty if the law declares nothing, or the record has no states: no message is read then.
    """
    import pandas as pd

    if not (units := _units(record)) or record.info.level == "physics":
        return pd.DataFrame()
    shared = read_shared(record)
    columns = ("_".join(filter(None, (it, name, units.get(name)))) for name, it in shared.columns)
    return shared.set_axis(list(columns), axis=1).rename_axis("t_s").reset_index()


def _units(record: RunRecord) -> dict[str, str]:
    return {it.name: it.unit for agent in record.info.agents[:1] for it in agent.control.law.shared}


def shared_records(cases: Mapping[str, CheckedCase]) -> dict[str, SharedRecord]:
    found: dict[str, SharedRecord] = {}
    for name, case in cases.items():
        declared = law_of(case.scenario, name).shared
        if not declared or case.folder is None or case.scenario.record == "physics":
            continue
        record = RunRecord.open(case.folder)
        for quantity in declared:
            with suppress(RecordFileError):  # nothing of it was sent
                frame = shared_frame(record, quantity.name)
                before = found[quantity.name].frames if quantity.name in found else {}
                found[quantity.name] = SharedRecord(quantity, {**before, name: frame})
    return found
