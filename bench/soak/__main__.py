"""Soak: an hour of the paper's feeder in real time, a process per agent, disturbed every few seconds.

    python -m bench.soak                                          an hour
    python -m bench.soak --hours 0.05 --seed 2                    three minutes

Agents leave, join, are killed and frozen; links are cut, healed and impaired; loads and a switch change: by the
commands of a user, drawn from the seed. Two agents stay all the time. Measured are memory (anonymous, resident) and
open files of every process, late steps of the plant, and how long all takes.

SIGTERM or Ctrl-C ends the run after the present disturbance; what was measured until then is judged. A second one
ends all at once.

Exit code: 0 all limits are kept, 1 one is not, 2 bad usage, 3 the run broke, 130 ended by Ctrl-C, 143 by SIGTERM.
"""

from __future__ import annotations

import signal
import sys
import tempfile
from pathlib import Path
from time import monotonic
from types import FrameType
from typing import Annotated

import pandas as pd
import typer

from bench.harness import MachineUse, commit, load, machine, markdown, say
from bench.soak.judging import (
    HEAL,
    Finding,
    ProcessSize,
    Verdict,
    growths,
    judge_checks,
    judge_growth,
    judge_late,
    judge_times,
)
from bench.soak.soak_actions import soak_actions
from bench.soak.soak_run import SoakRun
from bench.soak.watched_run import PATIENCE, SoakEnd, SoakError
from gridpeers.scenarios.live.run_client import NobodyError
from gridpeers.scenarios.schema import load_scenario
from gridpeers.wire.messages import PLANT

TOLD = 10
"""Actions between two reports of progress."""

SMALL = 100_000
"""Size (bytes) from which a file is listed."""


class StopRequest:
    """Handler of signals: it raises KeyboardInterrupt unless the soak can end well."""

    def __init__(self) -> None:
        self.disturbing = False
        """True while a disturbance lasts; the first signal then waits for its end."""
        self.asked: signal.Signals | None = None
        """The signal that asked for it."""

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Note the first request while the run is disturbed; raise at any other."""
        first, self.asked = self.asked is None, self.asked or signal.Signals(number)
        if not (first and self.disturbing):
            raise KeyboardInterrupt

    @property
    def exit_code(self) -> int:
        """Exit code of a soak that it ended; 0 of one that it did not."""
        return 0 if self.asked is None else 128 + self.asked


def main(
    hours: Annotated[float, typer.Option(min=10.0 / 3600.0, max=48.0, help="Length (h), in real time.")] = 1.0,
    seed: Annotated[int, typer.Option(help="Seed of the actions.")] = 1,
    keep: Annotated[Path | None, typer.Option(help="Keep record, logs and sizes.csv in this new folder.")] = None,
) -> None:
    """Run the paper's feeder in real time, disturb it every few seconds, and print the results."""
    if keep is not None:
        try:
            keep.mkdir(parents=True)
        except OSError as error:
            raise typer.BadParameter(f"{keep}: {error.strerror}; name a folder that does not exist yet") from None
    print(machine(), flush=True)
    stop = StopRequest()
    for number in (signal.SIGINT, signal.SIGTERM):  # even if the shell lets them be ignored, as in the background
        signal.signal(number, stop)
    with tempfile.TemporaryDirectory(prefix="gridpeers-soak-") as name:
        try:
            text, kept = soak(keep or Path(name), 3600.0 * hours, seed, stop)
        except (SoakError, NobodyError) as error:
            print(f"the run broke: {error}", file=sys.stderr)
            raise typer.Exit(3) from None
        except KeyboardInterrupt:
            print("interrupted; nothing is judged", file=sys.stderr)
            raise typer.Exit(stop.exit_code) from None
    print(text, flush=True)
    raise typer.Exit(stop.exit_code or (0 if kept else 1))


def soak(folder: Path, seconds: float, seed: int, stop: StopRequest) -> tuple[str, bool]:
    """Run for some time (s), or until a request; return the result as Markdown, and whether all limits were kept."""
    feeder = load_scenario("islanding")[1]
    microgrids = {row.name: row.microgrid for row in feeder.inverters}
    stays = [next(row.name for row in feeder.inverters if row.kind == kind) for kind in ("GFM", "GFL")]
    (spare, *_) = (row.name for row in feeder.spares)
    replaced = [name for name in microgrids if name not in stays]
    before, began = load(), monotonic()
    say("the run starts")
    with SoakRun(folder, microgrids, spare) as run:
        calm, use = monotonic(), MachineUse()
        count, stop.disturbing = 0, True
        for one in soak_actions(seed, replaced, tuple(microgrids), spare, sorted({*microgrids.values()})):
            if monotonic() - calm >= seconds or stop.asked is not None:
                break
            run.disturb(one)
            count += 1
            if count % TOLD == 1:
                say(f"{(monotonic() - calm) / 60.0:.1f} min: {count} actions, {run.monitor.t:.0f} s, last {one}")
        lasted, stop.disturbing = monotonic() - calm, False
        say("the run ends, and makes its report")
        end = run.finish()
    pd.DataFrame(run.sizes, columns=ProcessSize._fields).to_csv(folder / "sizes.csv", index=False)
    stayed = (PLANT, "command", *stays)
    sizes = {"memory (MB)": growths(run.sizes, "memory", stayed), "open files": growths(run.sizes, "files", stayed)}
    findings = [judge_growth(what, rows, lasted) for what, rows in sizes.items()] + judged(run, end, use.others)
    for timed in run.times:
        if timed.seconds >= HEAL / 2.0:
            print(f"t = {timed.t:.1f} s: {timed.what} took {timed.seconds:.2f} s: {timed.of}{' (deaf)' * timed.deaf}")
    for problem in run.problems:
        print(problem)
    for what, rows in sizes.items():
        print(f"\n{what}\n{pd.DataFrame(rows, columns=['', 'warm', 'last']).to_string(index=False)}")
    length = f"{lasted / 60.0:.0f} min"
    if stop.asked is not None:
        length = f"ended after {length} of {seconds / 60.0:.0f} by {stop.asked.name}"
    about = (
        f"{machine()}; commit {commit()}; {length}, seed {seed}, {count} actions; "
        f"load (1, 5, 15 min) {before} before and {load()} after"
    )
    print(f"{monotonic() - began:.0f} s in all")
    return f"{about}.\n\n{markdown(('what', 'limit', 'found', ''), findings)}", all(
        one.verdict != "FAIL" for one in findings
    )


def judged(run: SoakRun, end: SoakEnd, others: float) -> list[Finding]:
    """Return the rows of the result but those of growth."""
    found = [judge_late(run.late, run.steps, others)]
    for what, name, limit in (
        ("heal", "end of a cut or freeze until both sides use each other", HEAL),
        ("told", "kill -9 until the plant reports it and nobody uses the agent", None),
        ("joined", "start of an agent until it and all others use each other", None),
        ("restored", "frequency out of its band of 0.01 Hz, until it stays within", PATIENCE),
    ):
        of_kind = [timed for timed in run.times if timed.what == what]
        deaf = sum(timed.deaf for timed in of_kind)
        found.append(judge_times(name, [timed.seconds for timed in of_kind if not timed.deaf], limit, deaf))
    heals = [timed.t for timed in run.times if timed.what == "heal"]
    found.append(judge_checks(end.checks, end.silences, run.kills, heals))
    wrong = [*run.problems, *([] if end.status == 0 else [f"gridpeers up ended with {end.status}"])]
    verdict: Verdict = "FAIL" if wrong else "PASS"
    found.append(Finding("commands and processes", "none fails", "; ".join(wrong[:3]) or "all as asked", verdict))
    files = ", ".join(f"{name} {size / 1e6:.1f} MB" for name, size in end.files.items() if size > SMALL)
    found.append(Finding("files of the run", "", files, "-"))
    report = f"{end.report_s:.0f} s, up to {end.peak_MB:.0f} MB"
    found.append(Finding("its report", "", report, "-"))
    return found


app = typer.Typer(add_completion=False, rich_markup_mode=None)
app.command()(main)

if __name__ == "__main__":
    app()
