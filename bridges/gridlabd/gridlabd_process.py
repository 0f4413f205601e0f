"""Run GridLAB-D's power flow of a model in a process of its own."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
from contextlib import closing
from pathlib import Path
from typing import Any

from gridpeers.bridges.gridlabd.delta_mode_process import messages
from gridpeers.bridges.gridlabd.glm_text import GlmText
from gridpeers.plant.request_process import TransientFolder, no_room, program
from gridpeers.plant.tables.read import FeederError
from gridpeers.wire.wording import damaged, printable

POWER_FLOW = "gridpeers.bridges.gridlabd.gridlabd_power_flow"

MISSING = "reading .glm files needs GridLAB-D; install it: pip install 'gridpeers[gridlabd]'"

USER = "the import of .glm files"

LONGEST = 600.0
"""Time (s) after which a model that does not end is given up."""


def solved_model(path: Path, text: GlmText) -> dict[str, Any]:
    """Return what GridLAB-D's solver holds of a model (`gridlabd_power_flow`).

    Its `settling` says how regulators and capacitors moved until they rest, if any has a control. Where GridLAB-D finds
    no solution on the way, its `solved` is false, and all else is of the first moment. FeederError has GridLAB-D's own
    messages, each with its file and line.
    """
    if importlib.util.find_spec("gridlabd") is None:
        raise FeederError(path.name, (MISSING,))
    answer, printed = _asked(path, text)
    settling = answer.get("settling", {})
    if settling and not settling["solved"] and settling["seconds"]:
        answer, printed = _asked(path, text, "first")
        answer["settling"] = settling
    if not answer.get("solved", True):
        said = messages(printed) or [f"{path.name}: GridLAB-D's power flow does not converge"]
        if answer["method"] != "NR":
            said.append(
                f"{path.name}: has solver_method {answer['method']}, and is solved with NR here; try NR there, too"
            )
        raise FeederError(path.name, tuple(said))
    return answer


def _asked(path: Path, text: GlmText, *options: str) -> tuple[dict[str, Any], str]:
    """Return the answer of GridLAB-D's process, and the lines that it printed."""
    with closing(TransientFolder("gridpeers-gridlabd-")) as folder:
        result = folder.path / "result.json"
        model = text.readable(folder.path)
        command = program(POWER_FLOW, str(model), str(result), str(os.getpid()), *options)
        try:
            done = subprocess.run(
                command,
                cwd=path.parent,
                env=os.environ | {"PYTHONDONTWRITEBYTECODE": "1"},
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                pass_fds=(folder.user,),
                timeout=LONGEST,
                check=False,
            )
        except subprocess.TimeoutExpired:
            raise FeederError(path.name, (f"GridLAB-D did not end within {LONGEST:g} s; simplify the model",)) from None
        printed = done.stdout.decode("utf-8", errors="replace")
        if done.returncode == os.EX_CANTCREAT:
            problem = no_room("what GridLAB-D has solved", printable(printed.splitlines()[-1]))
            raise FeederError(path.name, (f"{path.name}: {problem}",))
        if not result.is_file():
            ended = (
                f"GridLAB-D's process ended with code {done.returncode} and said nothing; run the model in GridLAB-D"
            )
            raise FeederError(path.name, tuple(messages(printed)) or (ended,))
        answer: dict[str, Any] = json.loads(result.read_text(encoding="utf-8"))
    if "not_importable" in answer:
        raise FeederError(path.name, (damaged("gridlabd", printable(answer["not_importable"]), USER),))
    if "error" in answer:
        raise FeederError(path.name, tuple(messages(printed)) or (f"GridLAB-D: {printable(answer['error'])}",))
    return answer, printed
