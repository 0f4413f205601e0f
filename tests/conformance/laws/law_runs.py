"""Runs of the scenario islanding, case IV, under other laws."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any, Literal

import pytest

import gridpeers as gp

SHORT = {"time.end_s": 1.5, "event": [{"label": "event1", "t_s": 1.0, "open": ["13-152"]}], "paper": ""}
"""One second on the grid, and half of one of the islands that form then."""


Driver = Literal["inprocess", "processes"]


@cache
def islanding(law: str = "consensus", *, short: bool = False, **parameters: Any) -> gp.Result:
    """Result of case IV under a law of the registry, or another reference, with these parameters."""
    changes: dict[str, Any] = {"case.IV.law": {"use": law, **parameters} if parameters else law}
    return gp.load("islanding").replace(changes | (SHORT if short else {})).run("IV")


def written(law: Any, *, driver: Driver = "inprocess") -> gp.Result:
    """Result of the short scenario with a law as a scenario writes it."""
    return gp.load("islanding").replace({"case.IV.law": law, **SHORT}).run("IV", driver=driver)


def failed(law: Any, *, driver: Driver = "inprocess") -> gp.Result:
    """The same of a law that fails: one warning tells it."""
    with pytest.warns(RuntimeWarning, match="a law failed, IV: inv1 at t = ") as told:
        result = written(law, driver=driver)
    assert [Path(warning.filename).name for warning in told] == ["law_runs.py"]
    return result
