"""Three agents that decide ten times a second: a scenario of which a campaign has many runs in a moment."""

from __future__ import annotations

import csv
from pathlib import Path

SMALL = """
name = "small"
without_agent = ["inv2", "inv3", "inv5", "inv6", "inv8", "inv9"]
{extra}

[time]
end_s = 1.2
T_c_s = 0.1
record_s = 0.05

[plant]
load_set = "event2"

[[event]]
label = "islanding"
t_s = 1.0
open = ["13-152", "60-160"]

[case.IV]
secondary = "all"
graph = "full"
"""
"""A run takes a tenth of a second."""


def small(folder: Path, extra: str = "") -> Path:
    file = folder / "small.toml"
    file.write_text(SMALL.format(extra=extra), encoding="utf-8")
    return file


def rows_of(folder: Path) -> list[dict[str, str]]:
    with (folder / "chaos.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))
