"""The command line: exit codes, words, and that bad input starts and writes nothing."""

import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any
from unittest.mock import ANY, Mock

import pytest
import typer
import typer.main

from gridpeers.cli.root import COMMANDS, SUMMARIES, app
from gridpeers.lab.commands import CHANGES, replay
from gridpeers.scenarios.catalogue_files import CATALOGUE
from gridpeers.scenarios.checks.check_registry import ALWAYS
from tests.command_line import invoke

ISLANDING = (CATALOGUE / "islanding.toml").read_text(encoding="utf-8")
SHORT = ISLANDING.replace("end_s = 7.0", "end_s = 1.2").partition('[[event]]\nlabel = "event2"')[0] + (
    '[case.I]\ntitle = "no control"\nsecondary = "none"\ngraph = "none"\n'
)
"""Case I, the first 1.2 s."""


pytestmark = pytest.mark.usefixtures("elsewhere")


@pytest.mark.parametrize("words", [(), ("link",)])
def test_no_command_is_cut_short_in_the_help(words: tuple[str, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    """The help of each command can be read to its end on a terminal of 80 columns."""
    monkeypatch.setenv("COLUMNS", "80")

    text = invoke(*words, "--help")[1].partition("this message and exit.\n")[2]
    lines = [line for line in text.splitlines() if line.startswith("  ")]

    assert lines
    assert [line for line in lines if not line.endswith(".") or line.endswith("...")] == []


HELPED = ["feeder", "sweep", "reproduce", "experiment", "up", "plant", "run", "link", "check"]


@pytest.mark.parametrize(("lines", "heavy"), [
    ([["list"]], {"numba", "numpy", "scipy", "pandas", "matplotlib", "zenoh", "msgspec"}),
    ([[name, "--help"] for name in HELPED], {"numba", "pandas", "matplotlib"}),
])  # fmt: skip
def test_what_is_only_read_does_not_wait_for_heavy_modules(lines: list[list[str]], heavy: set[str]) -> None:
    """The list, and the help of each command, import nothing that compiles, draws, connects or computes."""
    code = f"import sys\nfrom gridpeers.cli.root import app\nfor words in {lines}: app(words, standalone_mode=False)\n"
    code += f"print(sorted({heavy} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)

    *printed, imported = done.stdout.splitlines()
    assert printed
    assert imported == "[]"


def test_list_shows_the_catalogue() -> None:
    code, text = invoke("list")

    assert code == 0
    assert any(line.startswith("islanding ") for line in text.splitlines())
    starts = {len(line) - len(re.sub(r"^\S+ +", "", line)) for line in text.splitlines()}
    assert len(starts) == 1, "titles stand below each other, however long a name is"
    assert "Cases: I, II, III, IV" in text


def test_check_says_that_a_file_can_be_run(elsewhere: Path) -> None:
    """A good file is told in one line, after what its events mean for the feeder."""
    (elsewhere / "mine.toml").write_text(ISLANDING)

    code, text = invoke("check", "mine.toml")

    assert code == 0
    note, line = text.splitlines()
    assert note.startswith('NOTE  event "event2" at 4 s de-energises 18 buses ')
    assert line == "mine.toml: can be run: cases I, II, III, IV; 2 events; 7 s; 9 inverters on 134 buses"


def test_a_run_fills_its_folder_from_which_it_can_be_repeated(elsewhere: Path) -> None:
    """Scenario as run, metrics, history, events, figures, log and report; `gridpeers run FOLDER/scenario.toml`.

    metrics.json has exactly these keys, numbers where numbers are promised, null where nothing was restored or a reason
    is told.
    """
    (elsewhere / "short.toml").write_text(SHORT)

    command = ("run", "short.toml", "--driver", "inprocess", "--seed", "7", "--format", "svg", "--out", "here")
    code, text = invoke(*command, figures=True)

    assert code == 0, text
    assert "figure  here/plots/overview.svg\nreport  here/report.txt\n" in text
    here = elsewhere / "here"
    assert {path.name for path in here.iterdir()} == {
        *("I", "log", "plots", "metrics.json", "checks.json", "report.txt", "scenario.toml", "status.txt")
    }
    assert (here / "status.txt").read_text() == "complete\n"
    assert sorted(path.name for path in (here / "I").iterdir()) == ["events.csv", "history.csv", "run.mcap"]
    as_run = tomllib.loads((here / "scenario.toml").read_text())
    assert as_run["seed"] == 7
    assert as_run["as_run"].keys() >= {"driver", "gridpeers", "python", "eclipse-zenoh"}

    found = json.loads((elsewhere / "here" / "metrics.json").read_text())
    measures = found["cases"]["I"].pop("event1")
    only = {"I": {"history_sha256": ANY}}
    assert found == {"scenario": "islanding", "seed": 7, "driver": "inprocess", "cases": only}
    reasons = measures.pop("reasons")  # the window is too short for all to be steady
    assert measures.keys() == {"f_error_Hz", "MPSI", "V_error", "MQSI", "t_restore_s", "t_load_s"}
    assert measures["t_restore_s"] is None
    nulls = {name for name, value in measures.items() if value is None}
    assert nulls == {"t_restore_s", *(reasons.keys() & measures.keys())}
    assert all(isinstance(value, float) for name, value in measures.items() if name not in nulls)

    code, text = invoke("run", "here/scenario.toml", "--driver", "inprocess", "--out", "again")

    assert code == 0, text
    assert Path("here/I/history.csv").read_bytes() == Path("again/I/history.csv").read_bytes()


def test_a_failed_claim_is_exit_code_1(elsewhere: Path) -> None:
    """A run with other parameters than the paper's is judged by the paper's claims all the same, if asked."""
    text = ISLANDING.replace("k_p = 0.0007", "k_p = 0.1")
    (elsewhere / "slow.toml").write_text(text)

    code, text = invoke("run", "slow.toml", "--driver", "inprocess", "--case", "IV", "--out", "here")

    assert code == 1
    assert "FAIL" in text
    assert "never" in text


@pytest.mark.parametrize(("check", "expected", "exit_code"), [
    ("fails", "", 1), ("fails", 'expected_failures = ["fails"]\n', 0), ("cannot_judge", "", 0),
])  # fmt: skip
def test_a_required_check_that_fails_unexpectedly_is_exit_code_1_and_one_that_is_not_judged_is_0(
    check: str, expected: str, exit_code: int, elsewhere: Path
) -> None:
    """A check that the run gives no occasion for has not failed; the line says that it was not judged."""
    judges = "def fails(case):\n    return [gp.Violation(text='late')]\n"
    judges += "def cannot_judge(case):\n    raise gp.NotJudgedError('no cut')\n"
    (elsewhere / "mine.py").write_text(f"import gridpeers as gp\n{judges}")
    off = ", ".join(f'{{ use = "{name}", off = true }}' for name in ALWAYS)
    (elsewhere / "short.toml").write_text(f'checks = ["mine:{check}", {off}]\n{SHORT}{expected}')

    code, text = invoke("run", "short.toml", "--driver", "inprocess", "--require-checks", "--details", "--out", "here")

    assert code == exit_code, text
    said = {"fails": "0 of 1 checks passed, ", "cannot_judge": "0 of 0 checks passed, 1 not judged, "}[check]
    assert f"CHECKS  case I: {said}frequency, voltage, power_sharing" in text
    assert "last_words switched off" in text


FAILING = """import gridpeers as gp

class Mine(gp.Law):
    def step(self, own, neighbours, T):
        return gp.SetPoints(own.P_set / 0.0, own.V_set)
"""


@pytest.mark.parametrize(("top", "exit_code", "line"), [
    ('on_law_failure = "stop"', 1, "FAILED  case IV: ended at t = 1.02 s, as on_law_failure says: inv1: law mine"),
    ('checks = [{ use = "law_failed", off = true }]', 0, "FAILED  case IV: inv1"),
])  # fmt: skip
def test_a_law_that_fails_is_exit_code_1_and_comes_first(top: str, exit_code: int, line: str, elsewhere: Path) -> None:
    """Whoever switches its check off has it said all the same; `compare`, `sweep` and `replay` follow one rule."""
    (elsewhere / "mine.py").write_text(FAILING)
    case = '[case.IV]\nsecondary = "all"\ngraph = "full"\n'
    text = SHORT.partition("[case.I]")[0].replace('paper = "islanding"', 'law = "mine:Mine"')
    (elsewhere / "short.toml").write_text(f"{top}\n{text}{case}")

    code, text = invoke("run", "short.toml", "--driver", "inprocess", "--out", "here")

    assert code == exit_code, text
    shown = text.removeprefix("islanding: case IV runs a law that failed\n").removeprefix("gridpeers: ")
    assert shown.startswith(line), text
    if "stop" not in top:
        assert (elsewhere / "here" / "report.txt").read_text().startswith(line)
        compared = invoke("compare", "here", "here", "--out", "c.png")[1]
        assert compared.startswith("FAILED  first, case IV: inv1: law mine:Mine (mine.py:5): step"), compared
        code, text = invoke("replay", "here", "--without", "inv1 -> inv2", "--out", "without")
        assert code == exit_code, text
    (elsewhere / "seeds.toml").write_text('scenario = "short.toml"\n[grid]\nseed = [1, 2]\n')
    code, text = invoke("sweep", "seeds.toml", "--jobs", "1", "--out", "seeds")
    assert code == exit_code, text


@pytest.mark.parametrize(("error", "exit_code", "said", "status"), [
    (RuntimeError("no such luck"), 3, "no such luck", "RuntimeError: no such luck (traceback in here/log/run.log)"),
    (KeyboardInterrupt(), 130, "interrupted; what came until then is in here/\n", "interrupted from the keyboard"),
])  # fmt: skip
def test_a_run_that_breaks_or_is_interrupted_says_so_on_the_screen_and_in_its_folder(
    error: BaseException, exit_code: int, said: str, status: str, elsewhere: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No history and no numbers bear its name."""
    monkeypatch.setattr("gridpeers.scenarios.drivers.inprocess.run_inprocess", Mock(side_effect=error))
    (elsewhere / "short.toml").write_text(SHORT)

    code, text = invoke("run", "short.toml", "--driver", "inprocess", "--out", "here")

    assert code == exit_code
    assert said in text
    assert "Traceback" not in text
    assert Path("here/status.txt").read_text() == f"broken: {status}\n"
    assert not [*Path("here").rglob("history.csv"), *Path("here").rglob("metrics.json")]
    log = Path("here/log/run.log")
    assert exit_code == 130 or "Traceback" in log.read_text()


def test_the_version_is_told_without_a_command() -> None:
    """`gridpeers --version` names the installed release, and the commit of a clone; "+" where it has changed."""
    from importlib.metadata import version

    code, text = invoke("--version")
    assert code == 0
    assert re.fullmatch(rf"gridpeers {re.escape(version('gridpeers'))} \([0-9a-f]{{7,}}\+?\)\n", text)


def test_a_command_alone_shows_its_help() -> None:
    assert "Print the version, and end." in invoke()[1]
    assert "Commands:" in invoke("link")[1]


def test_a_replay_without_a_change_names_every_option_that_changes_something() -> None:
    """All of its options but those that say which case, from when, and where to."""
    app = typer.Typer(add_completion=False)
    app.command()(replay)
    options = {max(each.opts, key=len) for each in typer.main.get_command(app).params if each.opts[0][:2] == "--"}

    assert options - {"--case", "--from", "--out", "--help"} == set(CHANGES.replace(" or ", ", ").split(", "))


def test_the_help_of_all_commands_has_the_first_sentence_of_each() -> None:
    """The line that is known without the command's module is the one that the module has, with an example below."""
    group: Any = typer.main.get_command(app)
    commands = {name: group.get_command(None, name) for name in SUMMARIES}

    found = {name: command.get_short_help_str(200) for name, command in commands.items()}
    assert [name for name, text in found.items() if not text.startswith(SUMMARIES[name])] == []
    lacking = [name for name, command in commands.items() if f"Example:  gridpeers {name}" not in command.help]
    assert lacking == ["feeder"]  # a group


def test_a_command_that_cannot_be_imported_leaves_the_others_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """It says why when it is called, with exit code 2; the command line starts, and lists it."""
    monkeypatch.setitem(COMMANDS.own, "mine", "no_such_module:command")

    code, text = invoke("mine")

    assert code == 2
    assert 'there is no module "no_such_module"' in text
    text = invoke("--help")[1]
    assert re.findall(r"^([\w-]+):$", text, re.MULTILINE) == [
        *("Options", "Start", "Study", "Live", "Inspect", "Feeder", "Plug-ins")
    ]
    assert text.partition("Plug-ins:")[2].split()[0] == "mine"
