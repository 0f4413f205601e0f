"""Links that are down for a while: groups that do not hear each other while the load falls, and a link that flaps."""

from __future__ import annotations

import numpy as np

from gridpeers.measures import Floats, Settling
from gridpeers.theory import Case, Loop, Ticks, Times, predicted_times, sharing_index
from papers.singhal2022.experiments.delay_experiment import of_times
from papers.singhal2022.experiments.experiment_data import CaseData, cut_between, without
from papers.singhal2022.experiments.experiment_output import (
    Curve,
    ExperimentResult,
    ExperimentTable,
    Look,
    Page,
    Panel,
    TableCell,
)

COLUMNS = (
    ("halves", ("halves", "halves-expire")),
    ("microgrids", ("microgrids", "microgrids-expire")),
    ("one follower alone", ("alone",)),
)
"""Panels side by side: cases with the last state held, then with states that expire."""

HELD, EXPIRED, WHOLE = 0, 1, 6
"""Styles."""

LOST = 1.0 - 1e-12
"""Probability that a message is lost in a partition, for the model, which asks for less than 1."""


def partition(told: CaseData) -> ExperimentResult:
    """Return F and MPSI over time, and what is left and comes back, in numbers."""
    split = told.scenario.cases["halves"].netem.partitions[0]
    event = told.scenario.events[-1]
    start, end = split.from_s, split.to_s or told.scenario.time.end_s
    panels = []
    for row, (title, measure) in enumerate((("f", told.f), ("MPSI", told.MPSI))):
        for name, cases in COLUMNS:
            curves = [Curve(x=told.t("whole"), y=measure("whole"), style=WHOLE, look="reference")]
            for style, case in zip((HELD, EXPIRED), cases, strict=False):
                curves.append(Curve(x=told.t(case), y=measure(case), style=style, look="solid"))
                t, said = predicted(told, case, end - event.t_s)
                curves.append(Curve(x=t + event.t_s, y=said[row], style=style, look="predicted"))
            panels.append(
                Panel(
                    title=f"{title}, {name}",
                    x_label="time (s)",
                    y_label=("f, mean of the GFM (Hz)", "MPSI")[row],
                    curves=curves,
                    spans=[(start, end)],
                    x_range=(2.0, told.scenario.time.end_s),
                    y_range=((59.97, 60.25), (0.0, 0.25))[row],
                )
            )
    looks: dict[Look, str] = {"predicted": "predicted for the time in groups"}
    names = {
        WHOLE: "no partition",
        HELD: "in groups, last state held",
        EXPIRED: "in groups, states expire after 0.25 s",
    }
    page = Page(
        title="In groups from 2.5 to 7 s (grey); a third of the load is lost at 3 s",
        panels=panels,
        columns=3,
        names=names,
        looks=looks,
        height=2.5,
    )
    return ExperimentResult(page=page, table=_table(told, start, event.t_s, end))


def predicted(told: CaseData, case: str, length: float) -> tuple[Floats, tuple[Floats, Floats]]:
    """Return the time after the loss of load (s), and f (Hz) and MPSI, as long as the groups last.

    What is held stays, as if all that follows were lost; what has expired is a link that is not there.
    """
    fleet, load = told.fleet(case), told.loads[told.scenario.events[-1].label]
    cut = cut_between(fleet, groups_of(told, case))
    expires = told.scenario.cases[case].handling.max_age > 0.0
    ticks = Ticks() if expires else Ticks(loss=dict.fromkeys(cut, LOST))
    loop = Loop(fleet=without(fleet, cut) if expires else fleet, ticks=ticks)
    nominal = load.load_pu * float(fleet.weight @ fleet.m_p)
    path = loop.run(round(length / fleet.T_c), load.start_pu * fleet.m_p, nominal, islanding=load.islanding)
    return path.t, (told.feeder.f_nom * (1.0 + path.e), sharing_index(path, fleet))


def groups_of(told: CaseData, case: str) -> dict[str, str]:
    """Return the group of each inverter in the case's partition."""
    (split,) = told.scenario.cases[case].netem.partitions
    microgrids = {row.name: row.microgrid for row in told.feeder.inverters}
    return {name: split.group(name, microgrids) or "" for name in microgrids}


def _table(told: CaseData, start: float, event: float, end: float) -> ExperimentTable:
    rows: list[list[TableCell]] = []
    for case, rule in told.scenario.cases.items():
        t, after = told.t(case), told.settling(case, end, told.scenario.time.end_s)
        apart = round(1e3 * (told.mean(told.f(case), case, end) - told.feeder.f_nom), 1) + 0.0  # no -0
        said: tuple[float, float] | tuple[str, str] = ("", "")
        if rule.netem.partitions:
            _, (f, MPSI) = predicted(told, case, end - event)
            said = round(1e3 * (float(f[-1]) - told.feeder.f_nom), 1), round(float(MPSI[-1]), 3)
        largest = 1e3 * float(np.abs(told.f(case)[t > end] - told.feeder.f_nom).max())
        shared = told.mean(told.MPSI(case), case, end)
        rows.append([rule.title, said[0], apart, said[1], round(shared, 3), *_back(after), round(largest, 1)])
    columns = (
        "case",
        "f - 60 before it ends, predicted (mHz)",
        "measured (mHz)",
        "MPSI before it ends, predicted",
        "measured",
        "f back after (s)",
        "sharing back after (s)",
        "largest abs(f - 60) after (mHz)",
    )
    return ExperimentTable(columns=columns, rows=rows)


def _back(after: Settling) -> tuple[TableCell, TableCell]:
    return after.t_f_s, after.t_share_s


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
    return ExperimentResult(page=page, table=_flapping_table(told))


def extra_age(rule: Case) -> float:
    """Mean age (s) that a case's flapping adds to what is held: d^2 / (2 (u + d)); while down, ages rise to d."""
    flaps = [entry.flap for entry in rule.netem.links if entry.flap is not None]
    return sum(flap.down_s**2 / (2.0 * (flap.up_s + flap.down_s)) for flap in flaps)


def _flapping_table(told: CaseData) -> ExperimentTable:
    ends = [event.t_s for event in told.scenario.events[1:]] + [told.scenario.time.end_s]
    rows: list[list[TableCell]] = []
    for case, rule in told.scenario.cases.items():
        row: list[TableCell] = [rule.title, extra_age(rule)]
        for event, end in zip(told.scenario.events, ends, strict=True):
            said = of_times(_flapping_predicted(told, case, event.label))
            found = told.settling(case, event.t_s, end)
            row += [said[0], found.t_f_s, said[1], found.t_share_s]
        rows.append(row)
    columns = ["case", "mean age added (s)"]
    for event in told.scenario.events:
        for what in ("f", "sharing"):
            columns += [f"{event.label}, {what}, predicted (s)", "measured (s)"]
    return ExperimentTable(columns=columns, rows=rows)


def _flapping_predicted(told: CaseData, case: str, label: str) -> Times:
    """Return times with the flapping link as one that is always late by its mean age; one that is cut is not there."""
    rule, fleet = told.scenario.cases[case], told.fleet(case)
    ends = ("inv4", "inv5")
    late = {(a, b): fleet.T_c + extra_age(rule) for a in ends for b in ends if a != b}
    if any(entry.cut for entry in rule.netem.links):
        return predicted_times(without(fleet, set(late)), load=told.loads[label])
    return predicted_times(fleet, link_delay_s=late, load=told.loads[label])
