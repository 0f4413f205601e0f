"""A project of a user's own adds a metric, a link fault, a graph and a claim, and touches nothing of ours."""

import sys
from pathlib import Path

import pytest

import gridpeers as gp

MODULE = '''
"""A study of jammed radio."""
from typing import Annotated

import gridpeers as gp


class Jammer(gp.LinkFault):
    """Lose most messages in the first part of every second, and delay the others."""

    share: Annotated[float, gp.Range(0, 1), "Part of a second."] = 0.2

    def judge(self, message, draws):
        if message.t % 1.0 < self.share and draws.uniform() < 0.9:
            return None
        return 0.01 * draws.uniform(1)


class Nearest:
    """Listen to the k next ones."""

    k: Annotated[int, gp.Range(1, 8), "How many."] = 2

    def __call__(self, members):
        names = list(members)
        return {a: [names[(i + j) % len(names)] for j in range(1, self.k + 1)] for i, a in enumerate(names)}


@gp.metric("f_min_Hz")
def nadir(window):
    """Lowest frequency of a grid-forming inverter (Hz)."""
    return window.history.xs("f", axis=1, level="quantity").loc[:, window.nameplates.GFM].min().min()


def jammed(found):
    """The frequency dips below 59.9 Hz while the radio is jammed."""
    f_min = found.own["radio"]["event1"].values["f_min_Hz"]
    return f_min < 59.9, f"{f_min:.3f} Hz"
'''

SCENARIO = """
name = "jammed"
metrics = [{ use = "my_study:nadir", name = "f_min_Hz" }]
claims = ["my_study:jammed"]
time.end_s = 1.4

[[event]]
label = "event1"
t_s = 1.0
open = ["13-152"]

[case.radio]
secondary = "all"
graph = { use = "my_study:Nearest", k = 3 }

[[case.radio.link]]
on = "* <-> *"
loss = 0.1
"my_study:Jammer" = { share = 0.3 }
"""


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A folder with a module and a scenario; Python knows nothing of it."""
    (tmp_path / "my_study.py").write_text(MODULE, encoding="utf-8")
    (tmp_path / "jammed.toml").write_text(SCENARIO, encoding="utf-8")
    return tmp_path


def test_a_users_own_module_is_measured_and_judged_alike_in_one_process_and_in_ten(project: Path) -> None:
    """Graph and fault reach the agents' processes; histories and fates of messages are the same to the byte."""
    scenario = gp.load(project / "jammed.toml")
    one, ten = (scenario.run("radio", driver=driver) for driver in ("inprocess", "processes"))

    assert one.sha256 == ten.sha256
    assert one.links_sha256 == ten.links_sha256 != ""
    assert {"fault", "loss", "passed"} <= set(one.links["fate"])
    assert one.metrics["f_min_Hz"]["event1"] == ten.metrics["f_min_Hz"]["event1"] < 59.9
    assert one.metrics.attrs["units"]["f_min_Hz"] == "Hz"
    assert "PASS     The frequency dips below 59.9 Hz while the radio is jammed  59." in one.report
    assert "Metrics of the scenario" in one.report
    assert one.sha256 != scenario.replace({"case.radio.graph.k": 1}).run("radio").sha256


def test_a_sweep_takes_a_metric_as_a_function_and_varies_parameters(project: Path) -> None:
    """The decorator names the column; missing values have their reasons beside."""
    scenario = gp.load(project / "jammed.toml").replace({"metrics": [], "claims": []})
    sys.modules.pop("my_study", None)
    import my_study  # type: ignore[import-not-found]

    table = gp.sweep(
        scenario,
        {"case.radio.graph.k": [2, 8]},
        metrics=["f_min_Hz", {"use": "my_study:nadir", "name": "again_Hz"}, lost],
        jobs=1,
    )

    assert my_study.nadir.__doc__
    assert list(table["event1.f_min_Hz"]) == list(table["event1.again_Hz"])
    assert table.attrs["units"]["event1.f_min_Hz"] == "Hz"
    assert table["event1.lost"].isna().all()
    assert table["metric_warnings"].str.startswith("event1: lost failed: KeyError: 'inv99'; the inverters are").all()


def lost(window):  # type: ignore[no-untyped-def]
    return window.history["inv99"]["f"].min()
