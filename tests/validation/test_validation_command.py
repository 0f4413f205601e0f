"""The command that runs the cross-validation."""

import pytest
from typer.testing import CliRunner

from bench.validation import __main__ as command
from bench.validation.validation_part import CaseResult, ToleranceCheck, ValidationPart, rounded_up


def part(value: float, needs: tuple[str, ...] = ("numpy",)) -> ValidationPart:
    """Return a part of one case with this value and a limit of 1."""
    return ValidationPart(
        "made-up", needs, {"one": "a case"}, lambda case: CaseResult(case, (ToleranceCheck("V, pu", value, 1.0),))
    )


@pytest.mark.parametrize("value", [1.5, float("nan")])
def test_a_broken_limit_is_printed_and_ends_the_command_with_1(value: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """A value beyond its limit, or a missing one, is a line on stderr and a cell of the table."""
    monkeypatch.setattr(command, "PARTS", {"made-up": part(value)})

    done = CliRunner().invoke(command.app, ["made-up"])

    assert done.exit_code == 1
    assert done.stderr.splitlines()[-1] == f"made-up: one: V, pu: {value:.3g} is beyond 1"
    assert f"| `one`: a case | {rounded_up(value)} | 1 |" in done.stdout


def test_a_missing_reference_is_one_line_that_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the package the command names it, runs nothing and ends with 2."""
    monkeypatch.setattr(command, "PARTS", {"made-up": part(0.0, ("no-such-reference",))})

    done = CliRunner().invoke(command.app, [])

    assert done.exit_code == 2
    assert done.stderr == "made-up needs no-such-reference: pip install 'gridpeers[validation]'\n"
    assert done.stdout == ""


@pytest.mark.parametrize(
    ("value", "text"), [(3.6e-11, "5e-11"), (1e-6, "1e-06"), (1.1e-6, "2e-06"), (6.0, "10"), (0.0, "0")]
)
def test_a_difference_is_rounded_up(value: float, text: str) -> None:
    """The table never shows a smaller difference than the real one."""
    assert rounded_up(value) == text
