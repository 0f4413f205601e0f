"""How commands that run for long are ended from outside."""

from __future__ import annotations

import signal
from collections.abc import Iterator

import pytest

from gridpeers.cli import app
from gridpeers.cli.usage import ended_by_signals, exit_code, interruptible


@pytest.fixture(autouse=True)
def restored() -> Iterator[None]:
    """The handlers of this process, put back whatever a test does to them."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.parametrize(("sent", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 143)])
def test_a_signal_ends_a_command_as_ctrl_c_does(sent: signal.Signals, code: int) -> None:
    """It comes as KeyboardInterrupt, the exit code says by what, and afterwards signals do what they did."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)

    with pytest.raises(KeyboardInterrupt) as ended, interruptible():
        signal.raise_signal(sent)

    assert exit_code(ended.value) == code
    assert [signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGHUP)] == [signal.SIG_IGN, signal.SIG_DFL]


def test_ctrl_c_passed_on_twice_is_one() -> None:
    """`timeout` signals a command and its group: what a command does at its end is not interrupted by the second."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    left = []

    def interrupted() -> None:
        try:
            signal.raise_signal(signal.SIGINT)
        finally:
            signal.raise_signal(signal.SIGINT)
            left.append("tidy")

    with pytest.raises(KeyboardInterrupt), interruptible():
        interrupted()

    assert left == ["tidy"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_before_the_command_line_is_read_ctrl_c_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A run starts its servers before all else, and whoever stops it in that moment sees no traceback."""

    def interrupted(driver: str) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(app, "_start_ahead", interrupted)

    with pytest.raises(SystemExit) as ended:
        app.main()

    assert (ended.value.code, capsys.readouterr().err) == (130, "gridpeers: interrupted before anything had begun\n")


def test_under_nohup_a_command_outlives_its_terminal() -> None:
    """The signal of a lost terminal stays ignored where the parent process ignores it."""
    signal.signal(signal.SIGHUP, signal.SIG_IGN)

    with interruptible():
        signal.raise_signal(signal.SIGHUP)


def test_a_command_that_a_signal_ends_says_what_is_left(capsys: pytest.CaptureFixture[str]) -> None:
    """One line on standard error, whatever the command was about to do."""
    with pytest.raises(SystemExit) as ended, ended_by_signals("half of it is in out/"):
        signal.raise_signal(signal.SIGTERM)

    assert (ended.value.code, capsys.readouterr().err) == (143, "gridpeers: interrupted; half of it is in out/\n")
