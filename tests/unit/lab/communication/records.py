"""Changes of islanding whose records have something to judge, and a record as if it had kept real time."""

from __future__ import annotations

import msgspec

from gridpeers.lab.communication.record_pass import RecordContent
from gridpeers.scenarios.checks.checked_case import CheckedCase
from tests.unit.scenarios.checks.cases import altered

LOSSY = (("case.IV.link", repr([{"on": "* <-> *", "loss": 0.2, "delay": 0.03}])),)
CUT = (("case.IV.link", repr([{"on": "inv2 <-> *", "cut": True, "from_s": 2.0, "to_s": 2.16}])), ("time.end_s", "5.0"))
QUIET = (("law", repr({"use": "event-triggered"})), ("case.IV.link", repr([{"on": "* <-> inv2", "loss": 0.1}])))
KILLED = (("node", repr([{"name": "inv2", "kill": True, "from_s": 2.0}])), ("time.end_s", "5.0"))


def in_real_time(case: CheckedCase) -> RecordContent:
    """The record of a case as if it had kept real time, in which every agent heard every state."""
    content = case.content
    info = msgspec.structs.replace(content.info, plant=msgspec.structs.replace(content.info.plant, clock="wall"))
    heard = {(src, dst): dict.fromkeys(content.states[src], "") for src in content.states for dst in content.states}
    return altered(content, info=info, heard={link: of for link, of in heard.items() if link[0] != link[1]})
