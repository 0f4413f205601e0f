from __future__ import annotations

import sys

import pytest

from gridpeers.cli.app import main


@pytest.mark.parametrize(("words", "said"), [
    (["--clock", "wall", "--driver", "inprocess"], "--clock wall: needs a process per agent; use "
     "--driver processes"),
    (["--clock", "wall", "--speed", "80"], "--speed: must be from 0.1 to 50 (1 is real time), got 80"),
    (["--clock", "wall", "--speed", "nan"], "--speed: must be from 0.1 to 50 (1 is real time), got nan"),
    (["--speed", "2"], "--speed: simulated time has no pace to keep; use it with --clock wall"),
    (["--strict"], "--strict: simulated time has no pace to keep; use it with --clock wall"),
])  # fmt: skip
def test_options_of_time_that_do_not_go_together_are_refused(
    words: list[str], said: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """One clear line and exit status 2, before anything is started."""
    monkeypatch.setattr(sys, "argv", ["gridpeers", "run", "islanding", *words])
    with pytest.raises(SystemExit) as ended:
        main()

    assert ended.value.code == 2
    assert capsys.readouterr().err == f"gridpeers: {said}\n"
