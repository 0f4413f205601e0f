"""A run whose folder is removed while it lasts."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from gridpeers.scenarios.run import run
from gridpeers.scenarios.run_request import BrokenRunError, Request
from gridpeers.scenarios.schema import load_scenario
from tests.scenario_files import written

SHORT = '[time]\nend_s = 0.1\n[case.calm]\nsecondary = "all"\ngraph = "ring"\n'


def test_a_run_whose_folder_is_removed_says_so(tmp_path: Path) -> None:
    """It names what it could not write, and no log that is gone as well."""
    scenario, feeder = load_scenario(written(tmp_path, SHORT))
    folder = tmp_path / "lab"
    folder.mkdir()

    def remove(case: str, t: float, end: float) -> None:
        if t > 0.0:
            shutil.rmtree(folder, ignore_errors=True)

    request = Request(scenario=scenario, feeder=feeder, driver="inprocess", folder=folder)
    with pytest.raises(BrokenRunError) as caught:
        run(request, remove)

    assert str(caught.value).endswith("cannot be written: No such file or directory")
    assert str(folder) in str(caught.value)
