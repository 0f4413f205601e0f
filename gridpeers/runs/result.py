"""Results of a run: tables, figures and verdicts, read from its folder."""

from __future__ import annotations

import re
import shutil
import sys
from base64 import b64encode
from collections.abc import Iterator, Mapping
from functools import cached_property
from html import escape
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
import pandas as pd

from gridpeers.plant.equipment import Tables
from gridpeers.rooms import ROOMS
from gridpeers.runs import frames
from gridpeers.runs.run_folder import RunFolder, new_home
from gridpeers.scenarios.checks import check_verdict
from gridpeers.scenarios.checks.check_verdict import CheckVerdict, judge_case
from gridpeers.scenarios.checks.checked_case import CheckedCase
from gridpeers.scenarios.record.record_info import LIVE
from gridpeers.scenarios.results.claims import Verdict, benchmark_of, claim_of, judge
from gridpeers.scenarios.results.findings import Findings, find
from gridpeers.scenarios.results.history import UNITS, History, windows
from gridpeers.scenarios.results.island_membership import taken_part
from gridpeers.scenarios.results.plots.drawing import Drawing, drawing_of
from gridpeers.scenarios.results.recorded_events import law_failures
from gridpeers.scenarios.results.run_files import FolderError, refusal, shown, write_whole
from gridpeers.scenarios.results.shared_quantities import shared_frame
from gridpeers.scenarios.schema import scenario_model as model
from gridpeers.scenarios.schema.plugin_keys import claims_of
from gridpeers.wire.messages import PlantEvent
from gridpeers.wire.wording import suggestion

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from gridpeers.lab.explanation.explanation import Explanation
    from gridpeers.scenarios.record.record_reader import RunRecord


class _FromFolder:
    spec: model.ScenarioModel
    """Scenario of the run, as typed values."""
    folder: Path
    """Folder with the files of the run (docs/reference/files-and-export.md)."""
    _repr_html_ = lambda self: html(repr(self), self.plot(), self.metrics)  # noqa: E731  # for notebooks; the classes below have plot and metrics

    def __init__(self, folder: RunFolder, spec: model.ScenarioModel, feeder: Tables) -> None:
        self._folder, self._feeder = folder, feeder
        self.spec = spec
        self.folder = folder.path

    @property
    def numbers(self) -> dict[str, Any]:
        """Content of metrics.json."""
        return self._folder.numbers

    @property
    def driver(self) -> str:
        """Driver of the run: "inprocess", "processes", or "live"."""
        return str(self.numbers["driver"])

    @property
    def report(self) -> str:
        """Report on all cases, as `gridpeers run` writes it; it names the folder if that is permanent."""
        return self._folder.read("report.txt", lambda file: file.read_text(encoding="utf-8"))


class Results(_FromFolder, Mapping[str, "Result"]):
    """Mapping from case to `Result`, for one run; `Scenario.run` and `gridpeers.read` return it."""

    def __init__(self, folder: RunFolder, spec: model.ScenarioModel, feeder: Tables) -> None:
        super().__init__(folder, spec, feeder)
        self._results = {case: Result(folder, spec, feeder, self, case) for case in spec.cases}

    def __getitem__(self, case: str) -> Result:
        if case not in self._results:
            raise KeyError(f'no case "{case}"; {suggestion(str(case), self._results, "cases")}')
        return self._results[case]

    def __iter__(self) -> Iterator[str]:
        return iter(self._results)

    def __len__(self) -> int:
        return len(self._results)

    @property
    def metrics(self) -> pd.DataFrame:
        """Metrics of all cases: a row per (case, window)."""
        frame = pd.concat({case: result.metrics for case, result in self.items()}, names=["case"])
        frame.attrs["units"] = next(iter(self.values())).metrics.attrs["units"]
        return frame

    @cached_property
    def saved_verdicts(self) -> Mapping[str, tuple[CheckVerdict, ...]]:
        """Verdicts of the checks by case, as the run saved them; empty without any."""
        file = self.folder / check_verdict.FILE
        return self._folder.read(file.name, check_verdict.read_verdicts) if file.exists() else {}

    @property
    def checks(self) -> pd.DataFrame:
        """Verdicts of the checks of all cases: a row per (case, check)."""
        return pd.concat({case: result.checks for case, result in self.items()}, names=["case"])

    @property
    def failures(self) -> pd.DataFrame:
        """Failed laws, a row each: case, t (s), agent, why; empty without failures."""
        return frames.failures_frame({case: law_failures(result.plant_events) for case, result in self.items()})

    @property
    def sha256(self) -> dict[str, str]:
        """Hash of each case's history."""
        return {case: result.sha256 for case, result in self.items()}

    def plot(self, figure: str = "overview") -> Figure:
        """Draw all cases in one figure.

        The figures are "overview", "frequency", "MPSI", "V_error", "MQSI", "voltage", "power_GFM", "power_GFL", shared
        quantities by name, and those for the events of the scenario. For another name, a ValueError lists them.
        """
        return _draw(self.drawing(self._results), figure)

    def save(self, folder: str | Path) -> Path:
        """Write the run folder with its figures into a new or empty folder, and return its path."""
        from gridpeers.scenarios.results.plots.run_figures import draw_all

        new = new_home(folder)
        try:
            shutil.copytree(self.folder, new, dirs_exist_ok=True)
            text = re.sub(r"\nResults: [^\n]*/\n\Z", "", self.report)
            write_whole(new / "report.txt", f"{text}\nResults: {shown(new)}/\n")
            if not (new / "plots").exists():
                draw_all(self.drawing(self._results), new / "plots")
        except OSError as error:
            raise FolderError(refusal(new, error)) from error
        return new

    @cached_property
    def findings(self) -> Findings:
        """Measures, as a claim gets them."""
        return find({case: result.checked_case for case, result in self.items()})

    @property
    def verdicts(self) -> tuple[Verdict, ...]:
        """Verdicts on the claims of the benchmark and of the scenario; empty for a live or changed run."""
        if self.driver == LIVE or any(self._folder.numbers_of(case).get("commands") for case in self):
            return ()
        claims = benchmark_of(self.spec.paper).claims
        return judge(self.findings, (*claims, *map(claim_of, claims_of(self.spec))))

    def drawing(self, cases: Mapping[str, Result]) -> Drawing:
        """Return the data of the figures of some cases (`gridpeers.scenarios.results.plots`)."""
        spec = msgspec.structs.replace(self.spec, cases={case: self.spec.cases[case] for case in cases})
        return drawing_of(spec, {case: result.checked_case for case, result in cases.items()})

    def __repr__(self) -> str:
        return f"<Results {self.spec.name}: cases {', '.join(self)}; {self.driver}>"


class Result(_FromFolder):
    """Result of one case; `Scenario.run` and `gridpeers.read` return it. It reads a table at the first use."""

    def __init__(self, folder: RunFolder, spec: model.ScenarioModel, feeder: Tables, run: Results, case: str) -> None:
        super().__init__(folder, spec, feeder)
        self._run = run
        self.case = case
        """Name of the case."""

    @cached_property
    def record(self) -> History:
        """Recorded rows as numpy arrays, by quantity."""
        return self._folder.recorded(self.case, lambda record: record.physics())

    @cached_property
    def history(self) -> pd.DataFrame:
        """Terminal quantities over time: columns (inverter, quantity), index t (s), units in `attrs["units"]`.

        KeyError names the inverters if there is none of a name.
        """
        frame = self.record.frame()
        named = frames.HistoryFrame(frame)
        named.attrs |= frame.attrs
        return named

    def quantity(self, name: str) -> pd.DataFrame:
        """Return f, P, Q, V, P_set, V_set or a shared quantity over time: a column per inverter, index t (s).

        The unit is in `attrs["units"]`. Raise RecordFileError if no law shared it, or the run was not recorded.
        """
        if name in UNITS and name != "t":
            frame: pd.DataFrame = self.history.xs(name, axis=1, level="quantity")
            frame.attrs["units"] = {"t": "s", name: UNITS[name]}
            return frame
        return shared_frame(self.run_record, name)

    @cached_property
    def metrics(self) -> pd.DataFrame:
        """Metrics: a row per window; nan without a steady value, with the reason in the column `reasons`."""
        return frames.metrics_frame(frames.windows_of(self._folder.numbers_of(self.case)))

    @cached_property
    def islands(self) -> pd.DataFrame:
        """Metrics of each island: a row per (window, island); empty if the run never has several islands.

        The name of an island is its first inverter. Sharing indices have no value over several islands together.
        """
        return frames.islands_frame(frames.windows_of(self._folder.numbers_of(self.case)))

    @cached_property
    def events(self) -> pd.DataFrame:
        """Events of the plant and the agents: time t (s), kind, subject, text."""
        return frames.events_frame(self.plant_events)

    @property
    def failures(self) -> pd.DataFrame:
        """Failed laws, a row each, as in `Results.failures`."""
        return frames.failures_frame({self.case: law_failures(self.plant_events)})

    @cached_property
    def links(self) -> pd.DataFrame:
        """Fate of every message on emulated links: src, dst, seq, t (s), delay (s; nan: dropped), fate."""
        return frames.links_frame(self._folder.recorded(self.case, lambda record: list(record.links())))

    @property
    def run_record(self) -> RunRecord:
        """Record of the case: messages, decisions with their inputs, events (docs/reference/files-and-export.md)."""
        return self._folder.record(self.case)

    @cached_property
    def plant_events(self) -> tuple[PlantEvent, ...]:
        """Events of the plant and the agents, as messages."""
        return self._folder.recorded(self.case, lambda record: record.events())

    def decision(self, agent: str, t: float) -> Explanation:
        """Explain the decision of an agent in force at a run time (s), as `gridpeers why` does.

        Raise RecordFileError for an unknown agent, before its first decision, or without a record.
        """
        found: Explanation = ROOMS.resolve("explain")(self.run_record, agent, t)
        return found

    @cached_property
    def sha256(self) -> str:
        """SHA-256 of the bytes of the recorded rows; equal runs have equal hashes."""
        return self.record.sha256

    @property
    def links_sha256(self) -> str:
        """SHA-256 of all fates of messages on emulated links; empty without such links."""
        return str(self._folder.numbers_of(self.case).get("links_sha256", ""))

    @cached_property
    def checked_case(self) -> CheckedCase:
        """The case as a check gets it."""
        measured = frames.windows_of(self._folder.numbers_of(self.case))  # a live run need not reach all events
        return CheckedCase(
            scenario=self.spec,
            feeder=self._feeder,
            case=self.case,
            history=taken_part(self.spec, self._feeder, self.record),
            windows=[window for window in windows(self.spec, self.plant_events) if window.label in measured],
            events=self.plant_events,
            messages_saved={label: of["messages_saved"] for label, of in measured.items() if of.get("messages_saved")},
            folder=self.folder / self.case,
        )

    @cached_property
    def check_verdicts(self) -> tuple[CheckVerdict, ...]:
        """Verdicts of the checks with all violations (docs/reference/measures-and-checks.md)."""
        saved = self._run.saved_verdicts
        return saved[self.case] if self.case in saved else judge_case(self.checked_case)

    @cached_property
    def checks(self) -> pd.DataFrame:
        """Verdicts of the checks: a row per check with status, number of violations, and the first one or a reason."""
        return frames.checks_frame(self.check_verdicts)

    @property
    def verdicts(self) -> tuple[Verdict, ...]:
        """Verdicts on the claims, over all cases of the run, as in `Results.verdicts`."""
        return self._run.verdicts

    def plot(self, figure: str = "overview") -> Figure:
        """Draw the case in one figure, as `Results.plot` does."""
        return _draw(self.drawing(), figure)

    def drawing(self) -> Drawing:
        """Return the data of the figures of the case (`gridpeers.scenarios.results.plots`)."""
        return self._run.drawing({self.case: self})

    def save(self, folder: str | Path) -> Path:
        """Write the run folder with all cases of the run, as `Results.save` does."""
        return self._run.save(folder)

    def __repr__(self) -> str:
        return f"<Result {self.spec.name} {self.case}: {self.driver}; history {self.sha256[:12]}>"


def html(title: str, figure: Figure, *tables: pd.DataFrame) -> str:
    """Return tables and a figure as a notebook shows them."""
    picture = BytesIO()
    figure.savefig(picture, format="png")
    parts = (table.drop(columns="reasons", errors="ignore").to_html(na_rep="-") for table in tables)
    source = f"data:image/png;base64,{b64encode(picture.getvalue()).decode()}"
    return f"<p>{escape(title)}</p>{''.join(parts)}<img style='max-width:60em;width:100%' src='{source}'>"


def _draw(drawing: Drawing, name: str) -> Figure:
    from gridpeers.scenarios.results.plots import run_figures  # imports matplotlib

    shown_in_notebooks()
    return run_figures.draw(drawing, name)


def shown_in_notebooks() -> None:
    """Let a notebook show a figure as a picture when it is the value of a cell, also without pyplot."""
    shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
    if shell is None:
        return
    from IPython.core.pylabtools import select_figure_formats
    from matplotlib.figure import Figure

    if shell.display_formatter.formatters["image/png"].for_type(Figure) is None:  # nobody has chosen a format
        select_figure_formats(shell, {"png"})  # type: ignore[no-untyped-call]
