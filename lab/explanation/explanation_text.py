"""An explanation as text: with colours on a terminal, plain in a file or a pipe."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rich.console import Console, RenderableType
from rich.table import Table
from rich.text import Text

from gridpeers.lab.explanation.explanation import Explanation, NeighbourAccount
from gridpeers.lab.explanation.law_step import QuantityStep
from gridpeers.scenarios.console import text_of as printed_text

SHOWN = 12

_SIDES = {1: "cannot deliver more", -1: "cannot deliver less"}


def text_of(explanation: Explanation) -> str:
    return printed_text(lambda console: print_explanation(explanation, console)).rstrip("\n")


def show(explanation: Explanation, console: Console) -> None:
    if console.is_terminal:
        print_explanation(explanation, console)
    else:
        console.print(text_of(explanation), soft_wrap=True)


def print_explanation(explanation: Explanation, console: Console) -> None:
    blocks = _head(explanation), _neighbours(explanation), *_steps(explanation), _events(explanation)
    for number, lines in enumerate(filter(None, map(list, blocks))):
        if number:
            console.print()
        for line in lines:
            console.print(line, soft_wrap=not isinstance(line, Table))


def _head(it: Explanation) -> Iterator[RenderableType]:
    decision, m = it.decision, it.decision.measurement
    config = decision.config
    case = f", case {it.case}" if it.case else ""
    yield Text.assemble(
        (f"{it.agent} at t = {decision.t:.2f} s", "bold"), f" ({it.scenario}{case}): {decision.in_words}"
    )
    yield from (Text(sentence, style="yellow") for sentence in it.aftermath)
    where = "grid-connected" if m.grid_connected else f"island {m.island or 'unknown'}"
    late = f", {decision.measurement_age} ticks old" if decision.measurement_age else ""
    e = (m.f - config.f_nom) / config.f_nom
    yield _table(
        ("measured" + late, "", "pu"),
        (
            ("f", f"{m.f:.4f} Hz", f"{e:+.6f} pu from nominal"),
            ("P", f"{m.P / 1e3:.2f} kW", f"{m.P / config.P_rated:.5f}"),
            ("Q", f"{m.Q / 1e3:.2f} kvar", f"{m.Q / config.P_rated:.5f}"),
            ("V", f"{m.V:.2f} V", f"{m.V / config.V_nom:.5f}"),
            ("", where, ""),
        ),
    )


def _neighbours(it: Explanation) -> Iterator[RenderableType]:
    heard = sum(account.used for account in it.neighbours)
    if not it.neighbours:
        yield Text("no neighbours: the graph has no link to it")
        return
    which = "neighbours in the sums" if it.step is not None else "neighbours heard, but no law used them"
    yield Text(f"{heard} of {len(it.neighbours)} {which}", style="bold")
    yield _table(
        ("neighbour", "age s", "weight", "P_set pu", "V_set pu", "Q pu", ""),
        tuple(map(_neighbour, it.neighbours)),
        left=(0, 6),
        styles=tuple("" if account.used and not account.why else "yellow" for account in it.neighbours),
    )


def _neighbour(account: NeighbourAccount) -> tuple[str, ...]:
    given = account.input
    age = "-" if given is None or given.age is None else f"{given.age:.3f}"
    weight = "-" if given is None else f"{given.weight:.3g}"
    values = ["-"] * 3
    if given is not None and given.state is not None:
        state, plate = given.state, given.nameplate
        pu = state.P_set / plate.P_rated, state.V_set / plate.V_nom, state.Q / plate.P_rated
        values = [f"{value:.5f}" for value in pu]
    return account.name, age, weight, *values, account.why


def _steps(it: Explanation) -> Iterator[list[RenderableType]]:
    decision, config = it.decision, it.decision.config
    bases = ("P_set", config.P_rated / 1e3, "kW"), ("V_set", config.V_nom, "V")
    if it.step is None:
        ends = zip(decision.before, decision.after, strict=True)
        yield [
            Text.assemble(
                (name, "bold"),
                f"  {before / scale:.2f} -> {after / scale:.2f} {unit}, "
                f"{before / scale / base:.6f} -> {after / scale / base:.6f} pu: no step of a law",
            )
            for (name, base, unit), scale, (before, after) in zip(bases, (1e3, 1.0), ends, strict=True)
        ]
        return
    for (name, base, unit), step, side in zip(bases, (it.step.P_set, it.step.V_set), decision.saturated, strict=True):
        yield _step(f"{name} of law {config.control.law.name}", step, base, unit, side)
    if it.step.problem:
        yield [Text.assemble(("NOTE", "yellow"), f"  one term: {it.step.problem}")]


def _step(title: str, step: QuantityStep, base: float, unit: str, side: int) -> list[RenderableType]:
    ends = f"{step.before * base:.2f} -> {step.after * base:.2f} {unit}, {step.before:.6f} -> {step.after:.6f} pu"
    terms = sorted(step.terms, key=lambda term: -abs(term.value))
    values = [(term.name, term.neighbour, term.value) for term in terms[:SHOWN]]
    if more := terms[SHOWN:]:
        values.append((f"{len(more)} further terms", "", sum(term.value for term in more)))
    values += [(f"limits {step.low:g} to {step.high:g}", "", step.limits), ("step", "", step.step)]
    rows = tuple((name, source, _signed(value), _share(value, step)) for name, source, value in values)
    note: list[RenderableType] = []
    if side:
        note = [Text(f"its inverter is saturated: it {_SIDES[side]}", style="yellow")]
    if step.after in (step.low, step.high) or step.limits:
        note.append(Text(f"at its {'upper' if step.after >= step.high else 'lower'} limit", style="yellow"))
    return [
        Text.assemble((title, "bold"), f"  {ends}"),
        _table(("term", "from", "pu", "of the step"), rows, left=(0, 1)),
        *note,
    ]


def _signed(value: float) -> str:
    return f"{value:+.3e}" if value else "0"


def _share(value: float, step: QuantityStep) -> str:
    return f"{round(100.0 * value / step.step, 1) + 0.0:.1f} %" if abs(step.step) > 1e-12 else "-"


def _events(it: Explanation) -> Iterator[RenderableType]:
    if it.events:
        yield Text("events of the second before", style="bold")
        yield from (Text(f"{event.t:8.2f} s  {event.text}") for event in it.events)
    yield from (Text.assemble(("NOTE", "yellow"), f"  {text}") for text in it.damage)


def _table(
    header: Sequence[str], rows: Sequence[Sequence[str]], left: Sequence[int] = (0,), styles: Sequence[str] = ()
) -> Table:
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="dim")
    for i, name in enumerate(header):
        table.add_column(Text(name), justify="left" if i in left else "right")
    for i, row in enumerate(rows):
        table.add_row(*map(Text, row), style=styles[i] if styles else "")
    return table
