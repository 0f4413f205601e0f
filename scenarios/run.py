"""One run from a checked scenario to its folder: cases, records, metrics, figures, claims, report.

The drivers (`scenarios.drivers`) are given configurations here, and their telemetry is taken.
"""

from __future__ import annotations

import json
import math
import platform
import traceback
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from importlib import metadata
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, TextIO

import msgspec

from agents.config import AgentConfig
from plant.config import PlantConfig
from plant.equipment import Feeder
from plant.pacing import sentence
from scenarios.drivers.outcome import Outcome
from scenarios.drivers.ports import endpoint
from scenarios.results.claims import CLAIMS, judge
from scenarios.results.drawing import Drawing, drawing_of
from scenarios.results.findings import Findings, find
from scenarios.results.folder import set_status, shown, write_whole
from scenarios.results.history import History, Plates
from scenarios.results.links import LinkRecord
from scenarios.results.moves import as_they_came, late_moves
from scenarios.results.record import Recorded, Recorder, RecordError
from scenarios.results.report import Report, plain
from scenarios.spec import Scenario
from scenarios.spec.configs import configs
from scenarios.spec.moves import inverters_of
from scenarios.spec.netem import netem_of, setup_of
from scenarios.spec.writing import to_toml
from wire.messages import Pacing, Telemetry
from wire.output import ReaderGoneError

Driver = Literal["processes", "inprocess"]
"""How a case is run: as one process per agent over Zenoh, or all in this process."""

Clock = Literal["simulated", "wall"]
"""Lock-step of plant and agents, or real time."""

Progress = Callable[[str, float, float], None]
"""Told the case, the time it has reached (s) and its end (s)."""

_VERSIONS = ("gridpeers", "eclipse-zenoh", "msgspec", "numpy", "scipy", "numba")


class TerminatedError(KeyboardInterrupt):
    """Somebody ended the command by SIGTERM; it closes as after Ctrl-C."""


class BrokenRunError(RuntimeError):
    """The run could not be finished; the folder says so too."""


@dataclass(frozen=True, kw_only=True)
class Request:
    """What is to be run."""

    scenario: Scenario
    """Checked; with the seed and the cases asked for."""
    feeder: Feeder
    """Its feeder."""
    driver: Driver
    folder: Path
    """An empty folder."""
    clock: Clock = "simulated"
    """Wall-clock time needs the driver "processes"."""
    speed: float = 1.0
    """Wall-clock: run time per wall time (s/s)."""
    strict: bool = False
    """Wall-clock: whether the run breaks when the plant cannot keep pace."""


def run(request: Request, progress: Progress) -> Report:
    """Run all cases and write the whole folder.

    Raises
    ------
    BrokenRunError
        If a case broke. What came until then stays in the folder, and `status.txt` tells that it is not whole.
    """
    (request.folder / "log").mkdir()
    with (request.folder / "log" / "run.log").open("w", encoding="utf-8") as log:
        try:
            return _run(request, progress, log)
        except KeyboardInterrupt as error:
            by = "by SIGTERM" if isinstance(error, TerminatedError) else "from the keyboard"
            set_status(request.folder, f"broken: interrupted {by}")
            raise
        except (BrokenRunError, ReaderGoneError) as error:
            print(f"broken: {error}", file=log)
            set_status(request.folder, f"broken: {error}")
            raise
        except Exception as error:
            traceback.print_exc(file=log)
            text = f"{type(error).__name__}: {error}"
            set_status(request.folder, f"broken: {text}")
            raise BrokenRunError(f"{text} (traceback in {shown(request.folder / 'log' / 'run.log')})") from error


def _run(request: Request, progress: Progress, log: TextIO) -> Report:
    scenario, folder = request.scenario, request.folder
    write_whole(folder / "scenario.toml", to_toml(scenario, _as_run(request)))
    recorded, notes = {}, []
    links_sha256: dict[str, str] = {}
    pacing: dict[str, Pacing] = {}
    for case in scenario.cases:
        links = LinkRecord()
        recorded[case], outcome = _run_case(request, case, progress, links)
        notes += [f"case {case}: {note}" for note in (*outcome.notes, *_checked_links(request, case, links))]
        links_sha256 |= {case: links.sha256} if links.counts else {}
        if outcome.pacing is not None:
            pacing[case] = outcome.pacing
            pace = sentence(outcome.pacing, scenario.time.T_c_s / request.speed)
            notes.append(f"case {case}, wall-clock time at speed {request.speed:g}: {pace}")
        notes += [f"case {case}: {note}" for note in late_moves(scenario, recorded[case].events)]
        print(
            f"case {case}: start {outcome.start_s:.2f} s, run {outcome.run_s:.2f} s, {outcome.ticks} ticks",
            *outcome.notes,
            sep="\n  ",
            file=log,
            flush=True,
        )
    plates = Plates.of(inverters_of(scenario, request.feeder))
    histories = {case: History.of(record.inverters, record.rows) for case, record in recorded.items()}
    came = {case: as_they_came(scenario, record.events) for case, record in recorded.items()}
    events = came[list(came)[-1]]  # in wall-clock time each case has its own
    found = find(scenario, request.feeder, plates, histories, came)
    sha256 = {case: record.sha256 for case, record in recorded.items()}
    write_whole(folder / "metrics.json", metrics_json(request, found, sha256, pacing, links_sha256))
    _draw(drawing_of(scenario, request.feeder, plates, histories, events), folder / "plots")
    report = Report(
        scenario=scenario.name,
        titles={case: rule.title for case, rule in scenario.cases.items()},
        found=found,
        verdicts=judge(found, CLAIMS[scenario.paper]) if scenario.paper else (),
        experiment=scenario.paper,
        notes=[*notes, *_notes(recorded, request.clock)],
        folder=shown(folder) + "/",
    )
    write_whole(folder / "report.txt", plain(report))
    set_status(folder, "complete")
    return report


def metrics_json(
    request: Request,
    found: Findings,
    sha256: Mapping[str, str],
    pacing: Mapping[str, Pacing],
    links_sha256: Mapping[str, str] = MappingProxyType({}),
) -> str:
    """Text of metrics.json; what is not a number (nothing to share) is null. Pacing in s of wall time."""
    cases: dict[str, dict[str, Any]] = {}
    for case, steady in found.results.items():
        cases[case] = {label: _numbers(asdict(values)) for label, values in steady.items()}
        for label, islands in found.islands.get(case, {}).items():
            cases[case][label]["islands"] = {name: _numbers(asdict(values)) for name, values in islands.items()}
        cases[case]["history_sha256"] = sha256[case]
        if case in links_sha256:
            cases[case]["links_sha256"] = links_sha256[case]
        if case in pacing:
            cases[case]["pacing"] = msgspec.to_builtins(pacing[case])
    scenario = request.scenario
    clock = {"clock": request.clock, "speed": request.speed} if request.clock == "wall" else {}
    whole = {"scenario": scenario.name, "seed": scenario.seed, "driver": request.driver, **clock, "cases": cases}
    return json.dumps(whole, indent=2, allow_nan=False) + "\n"


def _numbers(steady: dict[str, Any]) -> dict[str, Any]:
    measures = {name: value for name, value in steady.items() if name != "p"}
    return {name: value if value is not None and math.isfinite(value) else None for name, value in measures.items()}


def _checked_links(request: Request, case: str, record: LinkRecord) -> list[str]:
    """Write what emulated links did beside the history; what a reader must know of it."""
    if not record.counts:
        return []
    from scenarios.results.link_check import LinkCheck  # scipy.stats takes half a second to import

    netem = netem_of(request.scenario, case)
    setup = setup_of(netem, request.scenario, request.feeder, real_nodes=request.clock == "wall")
    check = LinkCheck(record, setup.netem, setup.microgrids)
    record.write(request.folder / case / "links.csv")
    write_whole(request.folder / case / "links.json", check.to_json())
    return list(check.lines())


def _run_case(request: Request, case: str, progress: Progress, links: LinkRecord) -> tuple[Recorded, Outcome]:
    """Run one case by the driver asked for, and record it."""
    time = request.scenario.time
    listen = endpoint(request.scenario.processes.port) if request.driver == "processes" else ""
    plant, agents = _timed(
        request, *configs(request.scenario, request.feeder, case, listen, real_nodes=request.clock == "wall")
    )
    with Recorder(request.folder / case) as recorder:

        def note(telemetry: Telemetry) -> None:
            recorder(telemetry)
            progress(case, recorder.rows[-1][0] if recorder.rows else 0.0, time.end_s)

        progress(case, 0.0, time.end_s)
        try:
            if request.driver == "inprocess":
                from scenarios.drivers.inprocess import run_inprocess

                outcome = run_inprocess(plant, agents, note, on_links=links)
            else:
                from scenarios.drivers.fleet import run_processes

                outcome = run_processes(plant, agents, request.folder / "log" / case, note, on_links=links)
            if outcome.broke:
                raise BrokenRunError(f"case {case}: {outcome.broke}")
            return recorder.finish(time.end_s, time.record_s), outcome
        except RecordError as error:
            raise BrokenRunError(f"case {case}: {error}") from error


def _timed(
    request: Request, plant: PlantConfig, agents: tuple[AgentConfig, ...]
) -> tuple[PlantConfig, tuple[AgentConfig, ...]]:
    """Give the configurations the kind of time asked for."""
    if request.clock == "simulated":
        return plant, agents
    if request.driver != "processes":
        raise BrokenRunError("wall-clock time needs one process per agent: use the driver processes")
    replace, clock, speed = msgspec.structs.replace, request.clock, request.speed
    plant = replace(plant, clock=clock, speed=speed, strict=request.strict)
    return plant, tuple(replace(agent, clock=clock, speed=speed) for agent in agents)


def _draw(drawing: Drawing, folder: Path) -> None:
    from scenarios.results.plots import draw_all  # matplotlib takes longer to import than a case to run

    draw_all(drawing, folder)


def _notes(recorded: Mapping[str, Recorded], clock: Clock) -> list[str]:
    """What makes a case differ from what its scenario says."""
    if clock == "wall":
        return ["in wall-clock time no two runs are the same: each has its own delays"]
    notes = []
    for case, record in recorded.items():
        if not record.reproducible:
            notes.append(f"case {case} cannot be reproduced: something happened in it that the scenario does not tell")
    return notes


def _as_run(request: Request) -> dict[str, Any]:
    return {"driver": request.driver} | versions()


def versions() -> dict[str, str]:
    """Versions of everything that has a part in the numbers of a run."""
    return {"python": platform.python_version()} | {name: _version(name) for name in _VERSIONS}


def _version(package: str) -> str:
    """Version of an installed package; one process does not need all of them."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "not installed"
