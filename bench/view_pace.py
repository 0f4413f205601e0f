"""Late steps of the plant with the page open and without, in turns in one real run.

    .venv/bin/python -m bench.view_pace [--agents 9] [--rounds 6] [--seconds 20]

A phase without has no view and no tab; a phase with has both, and begins when they have settled. Their start is counted
apart: Python and a tab that load take both cores of a small machine. A step is late when it is made more than one
control period after its due time, by the plant's own count; the delays are of measurements as they come here.
"""

from __future__ import annotations

from bench.harness import load, machine, options, say
from bench.viewed_run import ViewedRun, in_ms

SETTLED = 3.0
"""Time (s) from the first numbers on the page, or from its end, to the count."""


def main() -> None:
    """Measure in turns and print."""
    given = options(__doc__, agents=9, rounds=6, seconds=20.0)
    print(machine())
    late: dict[str, list[int]] = {"without": [], "with": [], "opening": []}
    steps = dict.fromkeys(late, 0)
    delays: dict[str, list[float]] = {name: [] for name in late}
    with ViewedRun(given.agents) as run:
        assert run.browser.is_connected()  # Chromium runs in both phases; the tab does not

        def count(phase: str, seconds: float) -> None:
            run.listen(0.2)
            run.take_delays()
            before = run.pacing()
            run.listen(seconds)
            after = run.pacing()
            late[phase].append(after.late - before.late)
            steps[phase] += after.steps - before.steps
            delays[phase] += run.take_delays()

        for k in range(given.rounds):
            say(f"round {k + 1} of {given.rounds}, load {load()}")
            run.listen(SETTLED)
            count("without", given.seconds)
            before = run.pacing()
            view = run.open_view()
            run.listen(SETTLED)
            after = run.pacing()
            late["opening"].append(after.late - before.late)
            steps["opening"] += after.steps - before.steps
            delays["opening"] += run.take_delays()
            count("with", given.seconds)
            run.close_view(view)
    print(
        f"{run.agents} agents, T_c {run.period * 1e3:g} ms, {given.rounds} rounds of {given.seconds:g} s, load {load()}"
    )
    for phase in ("without", "with", "opening"):
        each = ", ".join(map(str, late[phase]))
        print(f"  {phase:8} late steps: {sum(late[phase])} of {steps[phase]} ({each}); delays {in_ms(delays[phase])}")


if __name__ == "__main__":
    main()
