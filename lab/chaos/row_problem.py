"""Problems of a run in the journal of a campaign, which people can edit: what comes of it goes into files and names."""

from __future__ import annotations

import re

from gridpeers.lab.chaos.chaos_run import ChaosRow
from gridpeers.lab.chaos.disturbance import counted_kinds
from gridpeers.lab.chaos.disturbed_scenario import ChaosBase
from gridpeers.lab.chaos.schedule_report import schedule_lines
from gridpeers.wire.wording import printable

_CHECK = re.compile(r"\w{1,200}")
"""Form of a check's name: that of a class or of a key, and a file of `failures` is named by it."""

_AGAIN = "remove this line, and its run is done again"


def row_problem(base: ChaosBase, row: ChaosRow) -> str:
    """Return why a campaign cannot have a run, and what to do; "" if it can.

    Parameters
    ----------
    base : ChaosBase
        The scenario of the campaign.
    row : ChaosRow
        The run, as its journal has it.
    """
    if row.number < 0:
        return f"there is no run {row.number} in any campaign; remove this line"
    for name in row.violated:
        if not _CHECK.fullmatch(name):
            right = 'the name of a check has letters, digits and "_" alone, as "frequency"'
            return f'no check is called "{printable(name, 60)}": {right}; write that one, or {_AGAIN}'
    try:
        schedule_lines(base, row.schedule)
        counted_kinds([row.schedule])
        if row.violated:
            base.disturbed(row.schedule, 1, row.since_s)
    except (ArithmeticError, LookupError, RuntimeError, TypeError, ValueError) as error:  # an entry may be anything
        return f"its schedule is none that chaos draws ({printable(f'{type(error).__name__}: {error}', 200)}); {_AGAIN}"
    return ""
