"""Whatever a law's program does, it ends with its agent, and nothing that it has started is left."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from time import monotonic

import pytest

from gridpeers.agents.agent_config import LawChoice
from gridpeers.agents.carriers.law_registry import close_laws
from gridpeers.agents.carriers.program import LEAVING, ProgramLaw
from gridpeers.agents.laws.call import LawError
from gridpeers.agents.laws.law import Own

OWN = Own("inv1", True, 0.0, 0.5, 0.0, 1.0, 0.0, 0.0, 0.5, 1.0, 0.01, 0.05, 6e5, 277.0, 60.0)

STAYS = "sleep 600 & sleep 600"
"""A shell that ignores the end of its input, and has started another program."""

AGENT = f"""
import os, signal
from gridpeers.agents.carriers.program import ProgramLaw
from gridpeers.agents.agent_config import LawChoice
law = ProgramLaw(LawChoice(command=("sh", "-c", {STAYS!r})))
"""


@pytest.mark.parametrize("end", ["os.kill(os.getpid(), signal.SIGKILL)", "law.close()", "os._exit(1)"])
def test_nothing_outlives_an_agent_however_it_ends(end: str) -> None:
    """All of them hold the same pipe: its end comes once the last has gone."""
    subprocess.run([sys.executable, "-c", AGENT + end], stderr=subprocess.PIPE, timeout=30.0)


def test_programs_that_ignore_the_end_of_their_input_are_waited_for_together() -> None:
    """Each has 1 s to end, and so have all: one after the other they would have as many seconds as they are."""
    laws = [ProgramLaw(LawChoice(command=("sh", "-c", STAYS))) for _ in range(8)]
    began = monotonic()

    close_laws(laws)

    assert LEAVING <= monotonic() - began < len(laws) * LEAVING


SHORT, ENDS, LONG = 0.05, 0.3, 6.0
"""Limits (s) of a program that never answers, of one that ends meanwhile, and of one that answers sooner or later."""


@pytest.mark.parametrize(("script", "limit", "said"), [
    ("printf '{\"type\":'; sleep 600", SHORT, r"did not answer the start at t = 0 s within 0.5 s"),
    ("while :; do echo too much >&2; done", SHORT, r"did not answer the start at t = 0 s within 0.5 s"),
    ("sleep 600 & exit 3", ENDS, r"ended at the start at t = 0 s with exit code 3"),
    ("head -c 200000 /dev/zero | tr '\\0' x; sleep 600", LONG, r"answered the start at .* with more than 100000 bytes"),
])  # fmt: skip
def test_a_program_that_says_too_little_or_too_much_is_told_in_one_line(script: str, limit: float, said: str) -> None:
    """Half a line, endless complaints, an end that leaves another program, a line without end."""
    law = ProgramLaw(LawChoice(command=("sh", "-c", f"exec 2>/dev/null; read -r _; {script}"), time_limit=limit))
    try:
        with pytest.raises(LawError, match=said):
            law.start(OWN)
    finally:
        law.close()


def test_a_law_that_was_closed_says_so(tmp_path: Path) -> None:
    """It is called no more; and it can be closed twice."""
    law = ProgramLaw(LawChoice(command=("cat",), folder=str(tmp_path)))
    law.close()
    law.close()

    with pytest.raises(LawError, match="cat has ended before the start at t = 0 s"):
        law.start(OWN)
