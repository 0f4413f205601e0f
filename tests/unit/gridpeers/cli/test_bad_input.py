"""What is typed wrong, or cannot be used, is told before anything starts: exit code 2, and nothing is written."""

from __future__ import annotations

import re
import shlex
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from gridpeers.cli import usage
from gridpeers.runs import choices
from gridpeers.scenarios.catalogue_files import CATALOGUE
from tests.command_line import invoke

ISLANDING = (CATALOGUE / "islanding.toml").read_text(encoding="utf-8")
BAD_SCRIPT = "clear\nnew circuit.x basekv=4.16\nredirect missing.dss\nnew line.l1 lenth=3\nnew foo.l\n"
MINE = "--listen tcp/127.0.0.1:0"  # a run of somebody may be at the default endpoint

MISTYPED = [
    ("rnu", 'no command "rnu"; did you mean "run"?\n'),
    ("link sett", 'no command "sett"; did you mean "set"?\n'),
    ("run", "SCENARIO is missing: e.g. islanding, plug-n-play or partition; gridpeers list shows all"),
    ("run x --driver inproces", "'inprocess'; see gridpeers run -h"),
    ("run x --seed -1", "invalid value for '--seed'"),
    ("run x --spede 2", "--speed"),
    ("run x --case", "'--case' requires an argument"),
    ("run x y", "(y); see gridpeers run -h"),
    ("why x inv2 -1", "-1; see gridpeers why -h"),
    ("link cut inv1 inv4 --for long", "number; see gridpeers link cut -h"),
    ("event open", "SWITCH"),
    ("event toggle sw1_2", "'toggle' is not one of 'open', 'close'"),
    ("doc everything", "invalid value for 'TOPIC': 'everything' is not one of 'keys', 'messages'"),
    ("plant", "SCENARIO is missing: e.g. islanding"),
    ("agent", "missing argument 'INVERTER'"),
]
UNUSABLE = [
    ("why inv4", "AGENT is missing; RUN comes first: gridpeers why runs/islanding/latest/IV inv4 4.3"),
    ("link zebra", 'no command "zebra"; the commands are set, cut, heal'),
    ("run islandin", 'no scenario "islandin"; did you mean "islanding"?'),
    ("run nowhere.toml", "nowhere.toml: there is no such file"),
    (f"check {'a' * 300}", "cannot be read: File name too long"),
    ("run islanding --case V", '--case: no case "V"; did you mean "IV"? The cases are I, II, III, IV'),
    ("run islanding --clock realtime --speed 80", "--speed: must be from 0.1 to 50 (1 is real time)"),
    ("run islanding --clock wall", '--clock: "wall" is now called "realtime"; use --clock realtime'),
    ("run islanding --clock real", '--clock: there is no "real"; did you mean "realtime"?'),
    ("run islanding --strict", "--strict: simulated time has no pace to keep; use it with --clock realtime"),
    ("run islanding --out full", "--out full: the folder is not empty"),
    ("run bad.toml", "bad.toml:15: time.T_c_s: 20 s is not plausible"),
    ("check bad.toml", "2 problems:"),
    ("run used.toml", "cannot be used: address already in use"),
    (f"plant islanding --case V {MINE}", '--case: no case "V"; did you mean "IV"?'),
    ("plant islanding --listen tcp/192.0.2.1:1 --insecure", "--listen: tcp/192.0.2.1:1 cannot be used"),
    (f"plant islanding --speed 0 {MINE}", "--speed: must be from 0.1 to 50 (1 is real time), got 0"),
    (f"plant islanding --wait nan {MINE}", "--wait: must be a time of at least 0 s, got nan s"),
    (f"up islanding --for 0 {MINE}", "--for: must be a time of more than 0 s and at most 1e+09 s, got 0 s"),
    (f"up islanding --out full {MINE}", "--out full: the folder is not empty"),
    ("watch --for -1", "--for: must be a time of more than 0 s and at most 1e+09 s, got -1 s"),
    ("agent inv1 inv2 inv1", "INVERTER: inv1 is given twice; one agent controls an inverter\n"),
    ("agent 'inv 2'", 'INVERTER: "inv 2" cannot be part of a Zenoh key'),
    ("agent inv2 --wait -3", "--wait: must be a time of at least 0 s, got -3 s"),
    ("load 48", "nothing to set; give --factor, or one or both of --P (kW) and --Q (kvar)"),
    ("load 48 --factor 2 --P 9", "--factor: cannot go with --P or --Q"),
    ("load 48 --factor -1", "--factor: a factor on a load must not be negative, got -1; 0 to 10"),
    ("load 48 --factor 150", "--factor: 150 is not plausible for a factor on a load (0 to 10)"),
    ("load 48 --Q nan", "--Q: must be a finite number, got nan"),
    ("link set inv1 inv4", "nothing to set; give one of --delay, --jitter (with --delay), --loss,"),
    ("link set 'inv1 -> inv4' --loss 20", "--loss: 20 is not plausible for the probability of a loss (0 to 1); did"),
    ("link set inv1 inv4 --delay 100", "--delay: 100 s is not plausible for a delay (0 to 10 s); did"),
    ("link set inv1 inv4 --delay 0.1 --jitter 0.2", "--jitter: must be above 0 s, and at most"),
    ("link set inv1 inv4 --jitter 0.2", "--jitter: needs --delay"),
    ("link set inv1 inv4 --profile lt", '--profile: there is no profile "lt"; did you mean "lte"?'),
    ("link set inv1 inv4 --loss 0.1 --for -1", "--for: a time of the run must be above 0, got -1 s"),
    ("link cut plant plant", 'LINKS: "plant <-> plant" matches no link: both ends are plant;'),
    ("link cut inv1", 'LINKS: "inv1" names no links; write "inv4 <-> inv7"'),
    ("link cut inv1 inv4 inv7", 'LINKS: "inv1 inv4 inv7" is neither two names nor one pattern'),
    ("link heal inv1 -", "LINKS: the shell took the arrow for a redirection; put the pattern in quotes"),
    ("feeder import nothere.dss", "there is no such file"),
    ("feeder import nothere.glm", "there is no such file"),
    ("feeder import bad.txt", "the file of a feeder ends in .dss (OpenDSS) or .glm (GridLAB-D)"),
    ("feeder import bad.dss", "3 problems"),
    ("feeder check microgrid", 'no such feeder and no such folder; did you mean "microgrid123"?'),
    ("feeder solve microgrid123 --open sw9", 'switch "sw9": no such switch'),
    ("feeder solve microgrid123 --switch Line.l1", "switches, leave_out and f_nom are for .dss and .glm files"),
    ("feeder solve microgrid123 --load-set evnt2", 'load set "evnt2": no such set; there are event2, main'),
    ("feeder solve bad.dss --load-set main", "load_set is for a folder of tables"),
]


@pytest.fixture
def folder(elsewhere: Path) -> Iterator[Path]:
    """A folder with a folder that is not empty, files that cannot be used, and a port that is in use."""
    (elsewhere / "full").mkdir()
    (elsewhere / "full" / "mine.txt").write_text("mine")
    (elsewhere / "bad.toml").write_text(ISLANDING.replace("T_c_s = 0.02", "T_c_s = 20").replace("= 0.0007", "= 0"))
    (elsewhere / "bad.dss").write_text(BAD_SCRIPT)
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        (elsewhere / "used.toml").write_text(f"{ISLANDING}\n[processes]\nport = {taken.getsockname()[1]}\n")
        yield elsewhere


@pytest.mark.parametrize(("line", "said"), [*MISTYPED, *UNUSABLE])
def test_bad_input_is_told_and_leaves_nothing(folder: Path, line: str, said: str) -> None:
    """What, where, and what would be right; of a mistyped word in one line, which ends with the help to ask for."""
    before = sorted(folder.rglob("*"))

    code, text = invoke(*shlex.split(line))

    assert code == 2
    assert said in text
    assert all(each.startswith("gridpeers: ") for each in text.splitlines())
    assert re.search("; (see )?gridpeers ", text) or "did you mean" in text or (line, said) not in MISTYPED
    assert text.count("\n") == 1 or (line, said) not in MISTYPED
    assert sorted(folder.rglob("*")) == before


@pytest.mark.parametrize(
    "words",
    [["agent", "inv2"], ["watch"], ["event", "open", "sw1_2"], ["view", "--port", "0"]],
    ids=lambda words: words[0],
)
def test_nobody_there_is_told_within_the_wait(words: list[str]) -> None:
    """The endpoint, how long it was tried, and what to do."""
    if words[0] == "view":
        pytest.importorskip("starlette", reason="the extra view is not installed")
        pytest.importorskip("websockets", reason="the extra view is not installed")
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))  # nobody listens, and nobody else gets the port meanwhile
        endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"

        code, text = invoke(*words, "--connect", endpoint, "--wait", "0.2")

    line = [line for line in text.splitlines() if line.startswith("gridpeers: ")]
    assert code == 2
    assert line == [
        f"gridpeers: nothing answers at {endpoint} within 0.2 s; start a plant there (gridpeers plant SCENARIO), "
        "or name its endpoint by --connect; kill -CONT wakes a frozen plant"
    ]


@pytest.mark.parametrize("words", ["run islanding", "up islanding", "plant islanding", "agent inv2"])
def test_windows_is_told_that_it_runs_scenarios_in_one_process(words: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (usage, choices):
        monkeypatch.setattr(module, "POSIX", False)

    code, text = invoke(*words.split())
    assert (code, text.count("\n")) == (2, 1)
    assert "needs Linux or macOS; " in text
    assert "--driver inprocess" in text
