"""What all tests need of their surroundings."""

from __future__ import annotations

import signal
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings
from xdist.remote import Producer

from tests.pinned_kernels import choose
from tests.side_by_side import SLOW, RealTimeApart, compile_once, give_way, leave_out_slow

choose()

# A shell that runs its tests in the background, or nohup, has Ctrl-C ignored, and every process that a test starts
# would inherit that; but what Ctrl-C does is what some of them are about.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

give_way()

settings.register_profile("gridpeers", deadline=None)
settings.load_profile("gridpeers")
"""An example takes the time it takes: a machine that does other things beside it is no defect."""


@pytest.fixture
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(autouse=True)
def _own_modules(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Forget the modules that a test wrote and imported, and where they stood: the next one's `mine` is another."""
    known, path = set(sys.modules), list(sys.path)
    yield
    sys.path[:] = path
    written = str(tmp_path_factory.getbasetemp())
    for name in set(sys.modules) - known:
        if (getattr(sys.modules[name], "__file__", None) or "").startswith(written):
            del sys.modules[name]


@pytest.hookimpl(tryfirst=True)
def pytest_sessionstart(session: pytest.Session) -> None:
    """Compile before any worker or test, whose deadlines are those of a machine on which a plant has run before."""
    if not (session.config.option.collectonly or hasattr(session.config, "workerinput")):
        compile_once()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Have an option that runs everything."""
    parser.addoption("--all", action="store_true", help="Run the slow tests too.")


@pytest.hookimpl(tryfirst=True)
def pytest_configure(config: pytest.Config) -> None:
    """Take tests that are named as meant, slow ones too; workers get the option with the others."""
    if config.args_source is not config.ArgsSource.TESTPATHS:
        config.option.all = True


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave the slow tests out."""
    if not config.option.all:
        config.hook.pytest_deselected(items=leave_out_slow(items))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Say what was left out, and how to run it."""
    if not config.option.all:
        left_out = f"left out, as they take minutes: tests of {', '.join(SLOW.values())}"
        terminalreporter.write_line(textwrap.fill(left_out, terminalreporter._tw.fullwidth))  # noqa: SLF001
        terminalreporter.write_line("pytest -n 2 --all runs everything; pytest FOLDER runs one folder whole")


def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> RealTimeApart:
    """Share the tests out so that those that keep real time are undisturbed."""
    return RealTimeApart(config, log)
