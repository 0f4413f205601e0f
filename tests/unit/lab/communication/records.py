"""Changes of islanding whose records have something to judge, and a record as if it had kept real time."""

from __future__ import annotations

LOSSY = (("case.IV.link", repr([{"on": "* <-> *", "loss": 0.2, "delay": 0.03}])),)
CUT = (("case.IV.link", repr([{"on": "inv2 <-> *", "cut": True, "from_s": 2.0, "to_s": 2.16}])), ("time.end_s", "5.0"))
QUIET = (("law", repr({"use": "event-triggered"})), ("case.IV.link", repr([{"on": "* <-> inv2", "loss": 0.1}])))
KILLED = (("node", repr([{"name": "inv2", "kill": True, "from_s": 2.0}])), ("time.end_s", "5.0"))
