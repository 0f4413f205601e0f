"""The command `gridpeers replay`. What it needs is imported when it is used, so that help comes at once."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gridpeers.cli.usage import BAD_INPUT, CLAIM_FAILED, fail, require, terminal

if TYPE_CHECKING:
    from gridpeers.lab.replay.changes import Changes
    from gridpeers.scenarios.record.record_reader import RunRecord


CHANGES = "--without, --without-loss, --without-link-commands, --law or --set"


def replay(
    run: Annotated[
        Path, typer.Argument(metavar="RUN", help="Folder of a case, e.g. runs/islanding/latest/IV, or its run.mcap.")
    ],
    case: Annotated[str, typer.Option(metavar="NAME", help="Case of the run, if RUN has several.")] = "",
    without: Annotated[
        list[str] | None,
        typer.Option(metavar="LINKS", help='Cut links: "inv4 -> inv7", "inv4 <-> inv7"; can be repeated.'),
    ] = None,
    without_loss: Annotated[bool, typer.Option("--without-loss", help="Lose no message by chance.")] = False,
    without_link_commands: Annotated[
        bool, typer.Option("--without-link-commands", help="Leave out what people commanded the emulated links.")
    ] = False,
    law: Annotated[str, typer.Option(metavar="KEY", help="Another law: a name, or module:Class.")] = "",
    values: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="KEY=VALUE", help="A key of agents or links, e.g. gains.k_p=0.001; can be repeated."
        ),
    ] = None,
    since: Annotated[
        float, typer.Option("--from", metavar="T", help="Run time (s) from which on; up to it all is as it was.")
    ] = 0.0,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="New folder for what would have been; in runs/ when left out."),
    ] = None,
) -> None:
    """Replay a recorded run, or show what would have been.

    The cores get again what they got, when they got it, and must decide the same within 1e-9. With a change, the loop
    is closed on our plant from then on. docs/replay.md explains both.

    Exit code: 0 all that was compared is the same (notes say what was not), or what would have been is written,
    1 something differs from the record, or a law failed in what would have been, 2 bad usage, no record, or nothing in
    it to be replayed, 130 Ctrl-C, 143 SIGTERM.

    Example:  gridpeers replay runs/islanding/latest/IV --without "inv4 <-> inv7" --from 2
    """
    require({"mcap": "the record of a run", "numba": "the plant"})

    from gridpeers.cli.usage import ended_by_signals
    from gridpeers.lab.replay.changes import Changes
    from gridpeers.lab.replay.recorded_process import ReplayError
    from gridpeers.scenarios.record.record_reader import RecordFileError, RunRecord
    from gridpeers.scenarios.results.run_files import FolderError, refusal

    with ended_by_signals("nothing was written"):
        try:
            record = RunRecord.open(run, case)
            changes = Changes(
                without=tuple(without or ()),
                without_loss=without_loss,
                without_link_commands=without_link_commands,
                law=law,
                keys=dict(map(_key_and_value, values or ())),
                since=since,
            )
            differs = _counterfactual(record, changes, out) if changes else _replay(record, since, out)
        except ReplayError as error:
            fail(list(error.problems), BAD_INPUT)
        except (RecordFileError, FolderError) as error:
            fail([str(error)], BAD_INPUT)
        except OSError as error:
            fail([refusal(out or Path("runs"), error)], BAD_INPUT)
    _tell_notes(record.damage)
    if differs:
        raise SystemExit(CLAIM_FAILED)


def _key_and_value(text: str) -> tuple[str, Any]:
    """Read a key and its value, which is as in a scenario file; what is no value there is a text."""
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        fail([f"--set {text}: needs a key and its value, as gains.k_p=0.001"], BAD_INPUT)
    try:
        return key.strip(), tomllib.loads(f"value = {value}")["value"]
    except ValueError:
        return key.strip(), value.strip()


def _replay(record: RunRecord, since: float, out: Path | None) -> bool:
    if since:
        fail([f"--from {since:g}: nothing is changed from then on; give {CHANGES}"], BAD_INPUT)
    if out is not None:
        text = f"a replay without a change writes no folder; leave it out, or give {CHANGES}"
        fail([f"--out {out}: {text}"], BAD_INPUT)

    from gridpeers.cli.progress import explained
    from gridpeers.lab.replay.replay import replay as replay_record

    typer.echo(f"{_about(record)}: {record.t_end:.2f} s recorded")
    span = f"{record.t_end:.0f} s of {len(record.agents)} agents"
    with explained(lambda: typer.echo(f"still at work: every call of {span} is made again ...")):
        done = replay_record(record)
    for part in done.parts:
        of = "rows" if part.name == "plant" else "states"
        verdict = f"then {part.difference}" if part.difference else "the same" if part.count else "nothing to compare"
        typer.echo(f"  {part.name:<8}{part.count:>7} {of} up to {part.t_end:.2f} s: {verdict}")
    if done.difference is None and not any(part.count for part in done.parts):
        _tell_notes(done.notes)
        fail(["the record ends before anything that a replay could be compared with"], BAD_INPUT)
    if done.difference is None:
        same = "The replay gives what was recorded, within 1e-9"
        partly = bool(done.notes or record.damage)  # its damage is told behind the notes
        typer.echo(f"{same}, as far as it was compared:" if partly else f"{same}.")
    _tell_notes(done.notes)
    if done.difference is not None:
        typer.echo(f"The first difference: {done.difference}")
    return done.difference is not None


def _tell_notes(notes: Iterable[str]) -> None:
    for note in notes:
        typer.echo(f"NOTE  {note}")


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

    rule = changed_rule(record, changes)  # whatever is wrong is told before a folder is made

    typer.echo(f"{_about(record)}: {changes}")
    folder = new_folder(out, f"{record.info.scenario}-replay", datetime.now().astimezone())
    with ended_by_signals(f"what came until then is in {shown(folder)}/"), broken_if_ended(folder):
        with progress(terminal(), (record.info.case,)) as tell:
            done = counterfactual_in(record, rule, folder, tell)
        typer.echo(str(done))
        write_whole(folder / "comparison.txt", f"{changes}\n\n{done}\n")
        (figure,) = save(done.plot(), folder / "plots", "counterfactual")
    _tell_notes(done.notes)
    typer.echo(f"\nWhat would have been: {shown(folder)}/; figure: {shown(figure)}")
    if done.difference is not None:
        typer.echo(f"It is not to be trusted: before the change, {done.difference}")
    failed = len(done.would_be.failures) > 0 and judges_laws(rule.scenario)
    return done.difference is not None or failed


def _about(record: RunRecord) -> str:
    info = record.info
    kind = "wall-clock" if info.clock == "wall" else "simulated"
    return f"{info.scenario}{f', case {info.case}' if info.case else ''}, in {kind} time"
