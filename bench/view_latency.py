"""From an event in the plant to the screen, in a real run: plant step to pixel.

A load is set again and again; the plant reports each event with the step in which it happens. The time begins when
that step is due by the plant's schedule (the measurement that came soonest sets its zero, so the least transit of a
message, below 1 ms, is not in it) and ends when the page, in Chromium, begins the frame after the one that draws the
event. `mark` is the load's mark on the diagram, which takes one more question to the plant.

    .venv/bin/python -m bench.view_latency [--agents 9] [--events 150]
    .venv/bin/python -m bench.view_latency --agents 99     joined copies, several agents a process, T_c 100 ms
"""

from __future__ import annotations

import random

from bench.harness import load, machine, options, say
from bench.viewed_run import ViewedRun, clock_of, in_ms

LOAD = "48"

PROBE = """name => {
  const probe = window.probe = { events: [], marks: [], frames: 0 };
  const shown = then => requestAnimationFrame(() => requestAnimationFrame(() => then(performance.now() / 1000)));
  let seen = Math.max(0, ...gridpeersView.events.map(event => event.number));
  new MutationObserver(() => {
    for (const event of gridpeersView.events.filter(event => event.number > seen)) {
      seen = event.number;
      if (event.kind === "load") shown(at => probe.events.push([event.t, at]));
    }
  }).observe(document.getElementById("event-list"), { childList: true });
  let set = null;
  new MutationObserver(() => {
    const now = document.querySelector(`[data-load="${name}"]`).classList.contains("set");
    if (now !== set) { set = now; requestAnimationFrame(() => probe.marks.push(performance.now() / 1000)); }
  }).observe(document.querySelector(`[data-load="${name}"]`), { attributes: true, attributeFilter: ["class"] });
  const next = () => { probe.frames++; requestAnimationFrame(next); };
  next();
}"""
"""The page notes the run time of each event of a load and when it was on the screen. A mark changes within a frame, so
that the next one begins after it."""


def main() -> None:
    """Measure and print."""
    given = options(__doc__, agents=9, events=150, seed=1)
    print(machine())
    draw = random.Random(given.seed)
    with ViewedRun(given.agents) as run:
        say(f"{run.agents} agents run; the page opens")
        view = run.open_view()
        run.listen(5.0)
        clock = clock_of(view.page)
        view.page.evaluate(PROBE, LOAD)
        before, began = run.pacing(), view.page.evaluate("() => [probe.frames, performance.now() / 1000]")
        for k in range(given.events):
            run.set_load(LOAD, 1.0 if k % 2 else 1.1)
            run.listen(draw.uniform(0.4, 0.8))
        run.listen(2.0)
        after, probe = run.pacing(), view.page.evaluate("() => ({ ...probe, now: performance.now() / 1000 })")
        drift = clock_of(view.page) - clock
        zero = run.epoch
        events = [at + clock - zero - t for t, at in probe["events"]]
        marks = [at + clock - zero - t for (t, _), at in zip(probe["events"], probe["marks"], strict=False)]
        frames = (probe["frames"] - began[0]) / (probe["now"] - began[1])
        delays = run.take_delays()
    print(f"{run.agents} agents, T_c {run.period * 1e3:g} ms, load {load()}")
    print(f"  events that came to the screen: {len(events)} of {given.events}; {frames:.0f} frames a second")
    print(f"  event to screen (its line):  {in_ms(events)}")
    if len(probe["marks"]) == len(probe["events"]):
        print(f"  event to screen (its mark):  {in_ms(marks)}")
    print(f"  of it, the plant behind its due times: {in_ms(delays)}")
    print(f"  late steps: {after.late - before.late} of {after.steps - before.steps}; slipped {after.slipped:.3f} s")
    print(f"  clocks of page and bench moved by {1e3 * drift:+.2f} ms against each other")


if __name__ == "__main__":
    main()
