"""The command that writes docs/validation.md."""

from pathlib import Path

import pytest
from matplotlib.figure import Figure

from bench.validation.__main__ import main
from bench.validation.validation_part import CaseResult, ToleranceCheck, ValidationPart, rounded_up


def part(name: str, value: float, needs: tuple[str, ...] = ("numpy",)) -> ValidationPart:
    """Return a part of one case with this value and a limit of 1."""
    return ValidationPart(
        name,
        f"Part {name}",
        "Text.",
        needs,
        {"one": "a case"},
        lambda case: CaseResult(case, (ToleranceCheck("V, pu", value, 1.0),)),
        lambda results: Figure(),
    )


def test_a_broken_limit_ends_the_command_with_1_and_is_on_the_page(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A value beyond its limit, or none at all, is told on stderr, and shows on the page."""
    assert main([], [part("a", 1.5)], tmp_path) == 1
    assert "a: one: V, pu: 1.5 is beyond 1" in capsys.readouterr().err
    assert "| `one`: a case | 2 | 1 |" in (tmp_path / "validation.md").read_text()

    assert main([], [part("a", float("nan"))], tmp_path) == 1


def test_a_part_that_is_not_run_keeps_its_section(tmp_path: Path) -> None:
    """The page has the sections of all parts in their order, whichever were run last; a second run changes nothing."""
    parts = [part("a", 0.5), part("b", 0.1)]

    assert main(["b"], parts, tmp_path) == 0
    assert main(["a"], parts, tmp_path) == 0
    page = (tmp_path / "validation.md").read_text()
    assert main([], parts, tmp_path) == 0

    assert page.index("## Part a") < page.index("## Part b")
    assert (tmp_path / "validation.md").read_text() == page
    assert (tmp_path / "images/validation/a.png").exists()


def test_a_missing_reference_is_one_line_that_says_what_to_install(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Without the wheel the command ends with 2, names it, and writes nothing."""
    assert main([], [part("a", 0.0, ("no-such-reference",))], tmp_path) == 2
    assert capsys.readouterr().err == "a needs no-such-reference: pip install 'gridpeers[validation]'\n"
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("value", "text"), [(3.6e-11, "5e-11"), (1e-6, "1e-06"), (1.1e-6, "2e-06"), (6.0, "10"), (0.0, "0")]
)
def test_a_difference_is_rounded_up(value: float, text: str) -> None:
    """The page never tells a smaller difference than there is."""
    assert rounded_up(value) == text
