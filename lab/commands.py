"""Commands of the lab but `gridpeers chaos`. What they need is imported when it is used, so that help comes at once."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gridpeers.cli.usage import (
    BROKEN,
    CLAIM_FAILED,
    ScenarioName,
    argument,
    chosen,
    fail,
    flag,
    load,
    option,
    require,
    terminal,
)

if TYPE_CHECKING:
    from gridpeers.lab.replay.changes import Changes
    from gridpeers.scenarios.record.record_reader import RunRecord

RecordedRun = Annotated[Path, argument("RUN", "Folder of a case, e.g. runs/islanding/latest/IV, or its run.mcap.")]

CaseOfRun = Annotated[str, option("NAME", "Case of the run, if RUN has several.")]


def predict(
    scenario: ScenarioName,
    case: Annotated[str | None, option("NAMES", "Cases to predict, e.g. III,IV; all if left out.")] = None,
    vars_: Annotated[
        bool, flag("Predict modes of voltage and vars too, which takes a second or two.", "--vars/--no-vars")
    ] = True,
) -> None:
    """Predict the behaviour of a scenario from theory.

    It prints modes, settling times, limits of step and delay, and times to restore after each event. For the load of
    each event and the effect of V_set on vars, it runs the plant on droop alone. docs/understand/findings.md has
    the equations, and compares predictions with the plant.

    Example:  gridpeers predict islanding --case IV
    """
    spec, feeder = load(scenario)
    spec = chosen(spec, case, None)
    require({"numba": "the plant", "scipy": "the theory"})

    from gridpeers.lab.predict.prediction import predictions
    from gridpeers.scenarios.run_request import BrokenRunError

    if not feeder.inverters:
        fail(f"{scenario}: the feeder {feeder.name} has no inverters, so there is nothing to control")
    try:
        predicted = predictions(spec, feeder, voltage=vars_)
    except BrokenRunError as error:
        fail(str(error), code=BROKEN)
    typer.echo("\n\n".join(map(str, predicted.values())))


def why(
    run: RecordedRun,
    agent: Annotated[str, argument("AGENT", "Name of the inverter, e.g. inv4.")],
    t: Annotated[float, argument("TIME", "Run time (s) of the decision.")],
    case: CaseOfRun = "",
) -> None:
    """Explain a decision of an agent, term by term.

    It shows the measurement, each neighbour with the age of its state, each term of the law, and the limits.
    docs/how-to/explain-a-run.md has examples.

    Example:  gridpeers why runs/islanding/latest/IV inv4 4.3
    """
    require({"mcap": "the record of a run"})

    from gridpeers.lab.explanation.explanation import explain
    from gridpeers.lab.explanation.explanation_text import show
    from gridpeers.scenarios.record.record_reader import RunRecord

    if not isfinite(t):
        fail(f"TIME {t}: needs a run time in s, as 4.3")
    show(explain(RunRecord.open(run, case), agent, t), terminal())


def _tell_notes(notes: Iterable[str]) -> None:
    for note in notes:
        typer.echo(f"NOTE  {note}")


def trace(
    run: RecordedRun,
    out: Annotated[
        Path | None, option("FILE", "File of the trace; trace.pftrace beside the record if left out.")
    ] = None,
    case: CaseOfRun = "",
) -> None:
    """Write a run's messages as a Perfetto trace.

    https://ui.perfetto.dev opens the file. It has tracks of agents and links, an arrow for each message, losses and
    cuts, and f, P and MPSI on the same time axis.

    Example:  gridpeers trace runs/islanding/latest/IV
    """
    require({"mcap": "the record of a run"})
    require({"perfetto": "a Perfetto trace"}, "trace")

    from gridpeers.lab.trace import write_perfetto_trace
    from gridpeers.output_folders import files_written, shown
    from gridpeers.scenarios.record.record_reader import RunRecord

    record = RunRecord.open(run, case)
    target = out or record.path.with_name("trace.pftrace")
    with files_written(target):
        arrows = write_perfetto_trace(record, target)
    _tell_notes(record.damage)
    typer.echo(f"{shown(target)}: {arrows} messages")


CHANGES = "--without, --law or --set"


def replay(
    run: RecordedRun,
    case: CaseOfRun = "",
    without: Annotated[
        list[str] | None, option("LINKS", 'Cut these links: "inv4 -> inv7", "inv4 <-> inv7"; repeatable.')
    ] = None,
    law: Annotated[str, option("KEY", "Another law: a name, or module:Class.")] = "",
    values: Annotated[
        list[str] | None, option("KEY=VALUE", "A key of agents or links, e.g. gains.k_p=0.001; repeatable.", "--set")
    ] = None,
    since: Annotated[float, option("T", "Run time (s) from which links change; 0: the start.", "--from")] = 0.0,
    out: Annotated[Path | None, option("DIR", "New folder for the changed run; in runs/ if left out.", "--out")] = None,
) -> None:
    """Replay a recorded run, unchanged or with a change.

    Without a change, every process gets its recorded inputs again, and must give the same results within 1e-9. With a
    change, agents and gridpeers' own plant run in a closed loop. docs/how-to/explain-a-run.md explains both.

    Example:  gridpeers replay runs/islanding/latest/IV --without "inv4 <-> inv7" --from 2
    """
    require({"mcap": "the record of a run", "numba": "the plant"})

    from gridpeers.cli.usage import ended_by_signals
    from gridpeers.lab.replay.changes import Changes
    from gridpeers.output_folders import files_written
    from gridpeers.scenarios.record.record_reader import RunRecord

    with ended_by_signals("nothing was written"), files_written(out or Path("runs")):
        record = RunRecord.open(run, case)
        changes = Changes(
            without=tuple(without or ()), law=law, keys=dict(map(_key_and_value, values or ())), since=since
        )
        differs = _counterfactual(record, changes, out) if changes else _replay(record, since, out)
    _tell_notes(record.damage)
    if differs:
        raise SystemExit(CLAIM_FAILED)


def _key_and_value(text: str) -> tuple[str, Any]:
    """Read a key and its value, which is as in a scenario file; what is no value there is a text."""
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        fail(f"--set {text}: needs a key and its value, as gains.k_p=0.001")
    try:
        return key.strip(), tomllib.loads(f"value = {value}")["value"]
    except ValueError:
        return key.strip(), value.strip()


def _replay(record: RunRecord, since: float, out: Path | None) -> bool:
    if since:
        fail(f"--from {since:g}: nothing changes from then on; give {CHANGES}")
    if out is not None:
        text = f"a replay without a change writes no folder; leave --out away, or give {CHANGES}"
        fail(f"--out {out}: {text}")

    from gridpeers.cli.progress import explained
    from gridpeers.lab.replay.replay import replay as replay_record

    typer.echo(f"{_about(record)}: {record.t_end:.2f} s recorded")
    span = f"{record.t_end:.0f} s of {len(record.agents)} agents"
    with explained(lambda: typer.echo(f"still at work: replaying {span} ...")):
        done = replay_record(record)
    for part in done.parts:
        of = "rows" if part.name == "plant" else "states"
        verdict = f"then {part.difference}" if part.difference else "the same" if part.count else "nothing to compare"
        typer.echo(f"  {part.name:<8}{part.count:>7} {of} up to {part.t_end:.2f} s: {verdict}")
    if done.difference is None and not any(part.count for part in done.parts):
        _tell_notes(done.notes)
        fail("the record ends before the first decision that a replay could compare")
    if done.difference is None:
        same = "The replay gives what was recorded, within 1e-9"
        partly = bool(done.notes or record.damage)  # the command prints the damage after these notes
        typer.echo(f"{same}, as far as it was compared:" if partly else f"{same}.")
    _tell_notes(done.notes)
    if done.difference is not None:
        typer.echo(f"The first difference: {done.difference}")
    return done.difference is not None


def _counterfactual(record: RunRecord, changes: Changes, out: Path | None) -> bool:
    require({"matplotlib": "the figure", "pandas": "the table"})

    from datetime import datetime

    from gridpeers.cli.progress import progress
    from gridpeers.cli.usage import ended_by_signals
    from gridpeers.lab.replay.changes import changed_rule
    from gridpeers.lab.replay.counterfactual import counterfactual_in
    from gridpeers.scenarios.results.plots.style import save
    from gridpeers.scenarios.results.run_files import broken_if_ended, new_folder, shown, write_whole
    from gridpeers.scenarios.schema.plugin_keys import judges_laws

    rule = changed_rule(record, changes)  # it refuses wrong changes before a folder is made

    typer.echo(f"{_about(record)}: {changes}")
    folder = new_folder(out, f"{record.info.scenario}-replay", datetime.now().astimezone())  # noqa: TID251  # folders are named by the day
    with ended_by_signals(f"what came until then is in {shown(folder)}/"), broken_if_ended(folder):
        with progress(terminal(), (record.info.case,)) as tell:
            done = counterfactual_in(record, rule, folder, tell)
        typer.echo(str(done))
        write_whole(folder / "comparison.txt", f"{changes}\n\n{done}\n")
        (figure,) = save(done.plot(), folder / "plots", "counterfactual")
    _tell_notes(done.notes)
    typer.echo(f"\nWhat would have been: {shown(folder)}/; figure: {shown(figure)}")
    if done.difference is not None:
        typer.echo(f"Do not trust it: before the change, {done.difference}")
    failed = len(done.would_be.failures) > 0 and judges_laws(rule.scenario)
    return done.difference is not None or failed


def _about(record: RunRecord) -> str:
    info = record.info
    kind = "real" if info.clock == "realtime" else "simulated"
    return f"{info.scenario}{f', case {info.case}' if info.case else ''}, in {kind} time"
