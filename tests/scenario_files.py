"""Scenario files of tests, and what is wrong with them."""

from __future__ import annotations

from pathlib import Path

import pytest

from gridpeers.scenarios.schema import ScenarioError, load_scenario


def written(folder: Path, text: str) -> Path:
    path = folder / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return path


def problems(folder: Path, text: str) -> tuple[str, ...]:
    with pytest.raises(ScenarioError) as caught:
        load_scenario(written(folder, text))
    return caught.value.problems
