"""Soak: an hour by the clock of the paper's feeder, an agent a process, disturbed every few seconds.

    python -m bench.soak                                          an hour
    python -m bench.soak --hours 0.05 --seed 2                    three minutes
    python -m bench.soak --hours 1 --write docs/reliability.md    its table goes into the page

Agents leave, join, are killed and frozen; links are cut, healed and impaired; loads and a switch change: by the
commands of a user, drawn from the seed. Two agents stay all the time. Measured are memory (anonymous, resident) and
open files of every process, late steps of the plant with what explains them, and how long all takes.

SIGTERM or Ctrl-C ends the run after the disturbance that goes on; what there is is judged, and no page is written. A
second one ends all at once. Exit code: 0 all limits are kept, 1 one is not, 2 bad usage, 3 the run broke, 130 and 143
ended by Ctrl-C and SIGTERM.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from time import monotonic

from bench.harness import load, machine, say
from bench.peers.machine_use import commit
from bench.soak.judging import (
    HEAL,
    Finding,
    files_of,
    growths,
    judge_checks,
    judge_growth,
    judge_late,
    judge_times,
    memory_of,
    table,
)
from bench.soak.process_sizes import ProcessSize
from bench.soak.soak_actions import soak_actions
from bench.soak.soak_run import SoakRun
from bench.soak.stop_request import StopRequest, stop_request
from bench.soak.watched_run import PATIENCE, SoakEnd, SoakError
from scenarios.live.client.run_client import NobodyError
from scenarios.schema import load_scenario
from wire.messages import PLANT

BEGIN, END = "<!-- python -m bench.soak -->", "<!-- end -->"
"""Lines around the result in the page."""

SHORTEST, LONGEST = 10.0 / 3600.0, 48.0
"""Hours that a soak may last."""

STAY = 2
"""Agents that are never replaced: the first leader and the first follower of the paper."""

TOLD = 10
"""Actions after which progress is told."""

SMALL = 100_000
"""Size (bytes) up to which a file is not worth a word."""


def main(words: Sequence[str] | None = None) -> int:
    """Run, print the table, and write it; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--hours", type=float, default=1.0, help="length by the clock (default 1)")
    parser.add_argument("--seed", type=int, default=1, help="of the actions (default 1)")
    parser.add_argument("--write", type=Path, metavar="PAGE", help=f"put the result between {BEGIN} and {END}")
    parser.add_argument(
        "--keep", type=Path, metavar="DIR", help="keep record, logs and sizes.csv in this folder, which is new"
    )
    given = parser.parse_args(words)
    if not SHORTEST <= given.hours <= LONGEST:
        parser.error(f"--hours: must be {SHORTEST:.3g} to {LONGEST:g}, got {given.hours:g}")
    if given.write is not None and (wrong := _objection(given.write)):
        parser.error(f"--write: {wrong}")
    if given.keep is not None:
        try:
            given.keep.mkdir(parents=True)
        except OSError as error:
            parser.error(f"--keep: {given.keep}: {error.strerror}; name a folder that does not exist yet")
    print(machine(), flush=True)
    with stop_request() as stop, tempfile.TemporaryDirectory(prefix="gridpeers-soak-") as name:
        try:
            text, kept = soak(given.keep or Path(name), 3600.0 * given.hours, given.seed, stop)
        except (SoakError, NobodyError) as error:
            print(f"the run broke: {error}", file=sys.stderr)
            return 3
        except KeyboardInterrupt:
            print("interrupted; nothing is judged", file=sys.stderr)
            return stop.exit_code
    print(text, flush=True)
    if stop.asked is not None:
        return stop.exit_code
    if given.write is not None:
        write(given.write, text)
    return 0 if kept else 1


def soak(folder: Path, seconds: float, seed: int, stop: StopRequest) -> tuple[str, bool]:
    """Run for some time (s), or until a request; return the result as Markdown, and whether all limits were kept."""
    feeder = load_scenario("islanding")[1]
    microgrids = {row.name: row.microgrid for row in feeder.inverters}
    leader = next(row.name for row in feeder.inverters if row.kind == "GFM")
    follower = next(row.name for row in feeder.inverters if row.kind == "GFL")
    stays = [leader, follower][:STAY]
    (spare, *_) = (row.name for row in feeder.spares)
    replaced = [name for name in microgrids if name not in stays]
    before, began = load(), monotonic()
    say("the run starts")
    with SoakRun(folder, microgrids, spare) as run:
        calm = monotonic()
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
    rows = [",".join(ProcessSize._fields), *(",".join(map(str, one)) for one in run.sizes)]
    (folder / "sizes.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    findings = judged(run, end, lasted, (PLANT, "command", *stays))
    for late in run.late:
        causes = "; ".join(late.causes) or "UNEXPLAINED"
        print(f"t = {late.t:.1f} s: {late.steps} late, the plant waited {1e3 * late.waited:.0f} ms: {causes}")
    for timed in run.times:
        if timed.seconds >= HEAL / 2.0:
            print(f"t = {timed.t:.1f} s: {timed.what} took {timed.seconds:.2f} s: {timed.of}{' (deaf)' * timed.deaf}")
    for problem in run.problems:
        print(problem)
    for what, of in (("memory (MB)", memory_of), ("open files", files_of)):
        print(f"{what:24}{'warm':>9}{'last':>9}{'growth':>9}")
        for growth in growths(run.sizes, of, (PLANT, "command", *stays)):
            print(f"{growth.name:24}{growth.before:9.1f}{growth.after:9.1f}{100.0 * growth.part:8.1f} %")
    length = f"{lasted / 60.0:.0f} min"
    if stop.asked is not None:
        length = f"ended after {length} of {seconds / 60.0:.0f} by {stop.asked.name}"
    about = (
        f"{machine()}; commit {commit()}; {length}, seed {seed}, {count} actions; "
        f"load (1, 5, 15 min) {before} before and {load()} after"
    )
    print(f"{monotonic() - began:.0f} s in all")
    return f"{about}.\n\n{table(findings)}", all(one.verdict != "FAIL" for one in findings)


def judged(run: SoakRun, end: SoakEnd, lasted: float, stays: Sequence[str]) -> list[Finding]:
    """Return the rows of the result."""
    found = []
    for what, unit, of in (("memory", " MB", memory_of), ("open files", "", files_of)):
        found.append(judge_growth(what, unit, growths(run.sizes, of, stays), lasted))
    found.append(judge_late(run.late, run.steps))
    for what, name, limit in (
        ("heal", "end of a cut or freeze until both sides use each other", HEAL),
        ("told", "kill -9 until the plant tells it and nobody uses the agent", None),
        ("joined", "start of an agent until it and all others use each other", None),
        ("restored", "frequency out of its band of 0.01 Hz, until it held", PATIENCE),
    ):
        of_kind = [timed for timed in run.times if timed.what == what]
        deaf = sum(timed.deaf for timed in of_kind)
        found.append(judge_times(name, [timed.seconds for timed in of_kind if not timed.deaf], limit, deaf))
    heals = [timed.t for timed in run.times if timed.what == "heal"]
    found.append(judge_checks(end.checks, end.silences, run.kills, heals))
    wrong = [*run.problems, *([] if end.status == 0 else [f"gridpeers up ended with {end.status}"])]
    found.append(Finding("commands and processes", "none fails", "; ".join(wrong[:3]) or "all as asked", "PASS"))
    if wrong:
        found[-1] = found[-1]._replace(verdict="FAIL")
    files = ", ".join(f"{name} {size / 1e6:.1f} MB" for name, size in end.files.items() if size > SMALL)
    found.append(Finding("files of the run", "", files, "-"))
    report = f"{end.report_s:.0f} s, up to {end.peak_MB:.0f} MB"
    found.append(Finding("its report", "", report, "-"))
    return found


def _objection(page: Path) -> str:
    """Return why a page cannot take the result; "" if it can."""
    try:
        text = page.read_text(encoding="utf-8")
    except OSError as error:
        return f"{page}: {error.strerror}"
    if END not in text.partition(BEGIN)[2]:
        return f"{page}: has no lines {BEGIN} and {END}; put them where the result belongs"
    return ""


def write(page: Path, text: str) -> None:
    """Put the result between the lines of a page that are for it."""
    before, _, rest = page.read_text(encoding="utf-8").partition(BEGIN)
    page.write_text(f"{before}{BEGIN}\n{text}\n{END}{rest.partition(END)[2]}", encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
