"""A link that goes up and down: f and MPSI over time, and times beside those of a delay of the same mean age."""

from __future__ import annotations

from gridpeers.theory import Case, Times, predicted_times
from papers.singhal2022.experiments.delay_experiment import of_times
from papers.singhal2022.experiments.experiment_data import CaseData, without
from papers.singhal2022.experiments.experiment_output import (
    Curve,
    ExperimentResult,
    ExperimentTable,
    Page,
    Panel,
    TableCell,
)


def flapping(told: CaseData) -> ExperimentResult:
    """Return F and MPSI over time, and times after each event."""
    cases = told.scenario.cases
    panels = [
        Panel(
            title=title,
            x_label="time (s)",
            y_label=y_label,
            curves=[Curve(x=told.t(case), y=measure(case), style=i, look="trace") for i, case in enumerate(cases)],
            x_range=(0.5, told.scenario.time.end_s),
            y_range=y_range,
        )
        for title, measure, y_label, y_range in (
            ("Frequency", told.f, "f, mean of the GFM (Hz)", (59.88, 60.15)),
            ("Power sharing", told.MPSI, "MPSI", (0.0, 0.25)),
        )
    ]
    page = Page(
        title="A flapping link; islanding at 1 s, loss of load at 6 s",
        panels=panels,
        columns=1,
        names={i: case.title for i, case in enumerate(cases.values())},
        height=2.4,
    )
    return ExperimentResult(page=page, table=_table(told))


def extra_age(rule: Case) -> float:
    """Mean age (s) that a case's flapping adds to what is held: d^2 / (2 (u + d)); while down, ages rise to d."""
    flaps = [entry.flap for entry in rule.netem.links if entry.flap is not None]
    return sum(flap.down_s**2 / (2.0 * (flap.up_s + flap.down_s)) for flap in flaps)


def _table(told: CaseData) -> ExperimentTable:
    ends = [event.t_s for event in told.scenario.events[1:]] + [told.scenario.time.end_s]
    rows: list[list[TableCell]] = []
    for case, rule in told.scenario.cases.items():
        row: list[TableCell] = [rule.title, extra_age(rule)]
        for event, end in zip(told.scenario.events, ends, strict=True):
            said = of_times(_predicted(told, case, event.label))
            found = told.settling(case, event.t_s, end)
            row += [said[0], found.t_f_s, said[1], found.t_share_s]
        rows.append(row)
    columns = ["case", "mean age added (s)"]
    for event in told.scenario.events:
        for what in ("f", "sharing"):
            columns += [f"{event.label}, {what}, predicted (s)", "measured (s)"]
    return ExperimentTable(columns=columns, rows=rows)


def _predicted(told: CaseData, case: str, label: str) -> Times:
    """Return times with the flapping link as one that is always late by its mean age; one that is cut is not there."""
    rule, fleet = told.scenario.cases[case], told.fleet(case)
    ends = ("inv4", "inv5")
    late = {(a, b): fleet.T_c + extra_age(rule) for a in ends for b in ends if a != b}
    if any(entry.cut for entry in rule.netem.links):
        return predicted_times(without(fleet, set(late)), load=told.loads[label])
    return predicted_times(fleet, link_delay_s=late, load=told.loads[label])
