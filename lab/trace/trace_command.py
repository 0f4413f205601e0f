"""The command `gridpeers trace`. What it needs is imported when it is used, so that help comes at once."""

from __future__ import annotations

from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gridpeers.cli.usage import BAD_INPUT, fail, require

if TYPE_CHECKING:
    from gridpeers.scenarios.record.record_reader import RunRecord

MOST = 20_000


def trace(
    run: Annotated[
        Path, typer.Argument(metavar="RUN", help="Folder of a case, e.g. runs/islanding/latest/IV, or its run.mcap.")
    ],
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Perfetto trace; trace.pftrace beside the record when left out.")
    ] = None,
    svg: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Space-time diagram instead, as .svg, .pdf or .png.")
    ] = None,
    since: Annotated[
        float | None, typer.Option("--from", metavar="T", help="Begin of the diagram (s); 0 when left out.")
    ] = None,
    until: Annotated[
        float | None, typer.Option("--to", metavar="T", help="End of the diagram (s); 0.2 s later when left out.")
    ] = None,
    agents: Annotated[
        str, typer.Option(metavar="NAMES", help="Agents of the diagram, e.g. inv1,inv4,plant; all agents if left out.")
    ] = "",
    case: Annotated[str, typer.Option(metavar="NAME", help="Case of the run, if RUN has several.")] = "",
) -> None:
    """Write a run's messages as a Perfetto trace, or draw them.

    https://ui.perfetto.dev opens the trace: tracks of agents and links, an arrow for each message, losses and cuts, and
    f, P and MPSI on the same axis. With --svg a space-time diagram is drawn, whose lost messages end in a cross.

    Exit code: 0 the file is written, 2 bad usage, no record, or the file cannot be written.

    Example:  gridpeers trace runs/islanding/latest/IV --svg messages.svg --from 1.0 --to 1.1
    """
    require({"mcap": "the record of a run"})
    if svg is None:
        given = {"--from": since is not None, "--to": until is not None, "--agents": bool(agents)}
        if wrong := [name for name, is_given in given.items() if is_given]:
            fail([f"{', '.join(wrong)}: for a diagram; add --svg FILE. A Perfetto trace has the whole run"], BAD_INPUT)
        require({"perfetto": "a Perfetto trace"}, "install it: pip install 'gridpeers[trace]'; or give --svg FILE")
    else:
        if out is not None:
            fail(["--out: for a Perfetto trace; --svg names the file of the diagram. Give one of them"], BAD_INPUT)
        require({"matplotlib": "the diagram"})
        kinds = (".svg", ".pdf", ".png")
        if svg.suffix not in kinds:
            fail([f"--svg {svg}: must end in {', '.join(kinds)}"], BAD_INPUT)
    since = 0.0 if since is None else since
    end = since + 0.2 if until is None else until
    if not (isfinite(since) and isfinite(end) and 0.0 <= since < end):
        fail([f"--from {since:g} --to {end:g}: needs two run times in s, the later one second"], BAD_INPUT)

    from gridpeers.scenarios.record.record_reader import RecordFileError, RunRecord
    from gridpeers.scenarios.results.run_files import refusal, shown

    try:
        record = RunRecord.open(run, case)
        if svg is None:
            from gridpeers.lab.trace.perfetto_trace import write_perfetto_trace

            target = out or record.path.with_name("trace.pftrace")
            arrows = write_perfetto_trace(record, target)
            text = f"{arrows} messages"
        else:
            target = svg
            text = _draw(record, svg, since, end, agents)
    except RecordFileError as error:
        fail([str(error)], BAD_INPUT)
    except OSError as error:
        fail([refusal(target, error)], BAD_INPUT)
    for damage in record.damage:
        typer.echo(f"NOTE  {damage}")
    typer.echo(f"{shown(target)}: {text}")


def _draw(record: RunRecord, file: Path, since: float, until: float, agents: str) -> str:
    from gridpeers.lab.trace.flows import flows
    from gridpeers.lab.trace.space_time_diagram import space_time_diagram
    from gridpeers.scenarios.results.plots.style import save
    from gridpeers.scenarios.short_texts import in_order, short

    if since > record.t_end:
        fail([f"--from {since:g}: the record ends at {record.t_end:.2f} s"], BAD_INPUT)
    named = dict.fromkeys(name.strip() for name in agents.split(",") if name.strip())  # a name twice is one axis
    nodes = list(named) or in_order(record.agents)
    if unknown := [name for name in nodes if name not in (*record.agents, "plant")]:
        fail([f"--agents: there was no agent {unknown[0]}; agents are {short(record.agents)}, and plant"], BAD_INPUT)
    T_c = record.info.T_c
    found = [flow for flow in flows(record, max(0.0, since - 1.0), until) if flow.src in nodes and flow.dst in nodes]
    found = [flow for flow in found if since <= (flow.sent + T_c if flow.arrived is None else flow.arrived)]
    if len(found) > MOST:
        fail([f"--from {since:g} --to {until:g}: {len(found)} messages; at most {MOST} can be told apart"], BAD_INPUT)
    title = f"{record.info.scenario}{', case ' + record.info.case if record.info.case else ''}: messages"
    figure = space_time_diagram(found, nodes, since, until, T_c, title)
    save(figure, file.parent, file.stem, (file.suffix[1:],))  # type: ignore[arg-type]  # checked above
    lost = sum(flow.is_lost for flow in found)
    return f"{len(found)} messages, {lost} of them lost"
