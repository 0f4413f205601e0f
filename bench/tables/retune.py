"""The search for alpha and beta of the reduced communication graph: a grid, and the best point by a rule set before.

The paper re-tunes alpha and beta for its reduced graph and prints neither. Here each point of a grid is run on the
islanding of `scenarios/catalogue/reduced-communication.toml` with the clustered graph, and judged by what Table IV
judges by, five seconds after the event: among the points whose V_error is the table's 0.002 when printed as there, the
one with the least MQSI; where two print the same MQSI, the smaller beta, then the larger alpha.

    .venv/bin/python -m bench.tables.retune             # 31 runs, some 15 s on two cores
"""

from __future__ import annotations

from msgspec.structs import replace

from scenarios.schema import load_scenario
from scenarios.sweep.sweep_case import run_one
from scenarios.sweep.workers import cores, on_this_machine

ALPHA = (0.125, 0.25, 0.5, 1.0, 2.0)
BETA = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
V_ERROR = "0.002"
"""Table IV, all rows."""

Point = tuple[float, float]


def main() -> None:
    """Run the grid, print it, and name its best point."""
    scenario, _ = load_scenario("reduced-communication")
    scenario = replace(scenario, events=scenario.events[:1], time=replace(scenario.time, end_s=scenario.events[1].t_s))
    points = [(alpha, beta) for alpha in ALPHA for beta in BETA]
    cases = {"full": scenario.cases["full"]}
    for alpha, beta in points:
        gains = replace(scenario.gains, alpha=alpha, beta_GFM=beta, beta_GFL=beta)
        cases[f"a{alpha}-b{beta}"] = replace(scenario.cases["untuned"], gains=gains)
    whole = replace(scenario, cases=cases)
    runs = [(i, whole, case) for i, case in enumerate(cases)]
    measures = {end.number: end.measures for end in on_this_machine(runs, cores(), run_one)}
    print("alpha   beta   V_error pu   MQSI    restored")
    for i, (alpha, beta) in enumerate([(float("nan"), float("nan")), *points]):
        what = f"{alpha:<7g} {beta:<6g}" if i else f"{'full graph':14}"
        t = measures[i]["event1.t_restore_s"]
        shown = "never" if t is None else f"{t:.2f} s"
        print(f"{what} {measures[i]['event1.V_error']:<12.4f} {measures[i]['event1.MQSI']:<7.3f} {shown}")
    alpha, beta = best({point: measures[i] for i, point in enumerate(points, start=1)})
    print(f"best: alpha = {alpha:g}, beta_GFM = beta_GFL = {beta:g}")


def best(measures: dict[Point, dict[str, float | None]]) -> Point:
    """Return the best point by the rule above."""

    def rank(point: Point) -> tuple[float, float, float]:
        MQSI = measures[point]["event1.MQSI"]
        assert MQSI is not None
        return round(MQSI, 3), point[1], -point[0]

    return min((point for point in measures if f"{measures[point]['event1.V_error']:.3f}" == V_ERROR), key=rank)


if __name__ == "__main__":
    main()
