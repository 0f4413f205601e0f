"""Run GridLAB-D's power flow of a model in a process of its own, and understand what it says."""

from __future__ import annotations

import importlib.util
import json
import os
import re
import subprocess
from contextlib import closing
from pathlib import Path
from typing import Any

from plant.request_process import program
from plant.tables.read import FeederError
from plant.transient_folder import TransientFolder, no_room
from plant.wheels import damaged
from wire.printable import printable

POWER_FLOW = "plant.imports.gridlabd.gridlabd_power_flow"

MISSING = "reading .glm files needs GridLAB-D; install it: pip install 'gridpeers[gridlabd]'"

USER = "the import of .glm files"

LONGEST = 600.0
"""Time (s) after which a model that does not end is given up."""

PLACED = re.compile(r"^(?P<file>\S[^()]*)\((?P<line>\d+)\)\s*: (?P<text>.*)$")
"""A message of the loader: file, line, text."""

LEVELLED = re.compile(r"^(?:ERROR|FATAL)\s+\[[^\]]*\]\s*: (?P<text>.*)$")
"""A message of the simulation that ends it."""

FOLLOWING = re.compile(
    r"load failed at or near|#include failed|unable to load '|failed to load model file|model initialization failed"
    r"|run_preparation\(\) returned|shutdown after simulation|last (error|warning) message was repeated"
    r"|initialization failed$|dump complete to|tzinfo\.txt|environment startup failed"
)
"""Messages that only repeat that something failed."""


def solved_model(path: Path) -> dict[str, Any]:
    """Return what GridLAB-D's solver holds of a model (`plant.imports.gridlabd.gridlabd_power_flow`).

    Raises
    ------
    FeederError
        With GridLAB-D's own messages, each with its file and line, if it refuses the model or cannot solve it.
    """
    if importlib.util.find_spec("gridlabd") is None:
        raise FeederError(path.name, (MISSING,))
    with closing(TransientFolder("gridpeers-gridlabd-")) as folder:
        result = folder.path / "result.json"
        command = program(POWER_FLOW, path.name, str(result), str(os.getpid()))
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
    if not answer.get("solved", True):
        said = messages(printed) or [f"{path.name}: GridLAB-D's power flow does not converge"]
        if answer["method"] != "NR":
            said.append(
                f"{path.name}: has solver_method {answer['method']}, and is solved with NR here; try NR there, too"
            )
        raise FeederError(path.name, tuple(said))
    return answer


def messages(printed: str) -> list[str]:
    r"""Return what GridLAB-D complains of, each message once; what only repeats that something failed if nothing else.

    Examples
    --------
    >>> messages("x.glm(3): class 'foo' is not known\nx.glm(3): load failed at or near 'object foo'\n")
    ["x.glm:3: class 'foo' is not known"]
    >>> messages("ERROR    [INIT] : NR: no swing bus found\nWARNING  [INIT] : slow\n")
    ['GridLAB-D: NR: no swing bus found']
    """
    found: list[str] = []
    following: list[str] = []
    missing = ""
    for line in printed.replace("\r", "\n").splitlines():
        placed, levelled = PLACED.match(line), LEVELLED.match(line)
        if placed and placed["text"].startswith("include file open failed"):
            missing = placed["file"]  # its line is that of the file that includes it, which the next message names
            continue
        if placed and missing:
            found.append(f"{Path(placed['file']).name}:{placed['line']}: {missing} is included, and cannot be read")
            missing = ""
            continue
        if placed:
            text = f"{Path(placed['file']).name}:{placed['line']}: {printable(placed['text'].strip())}"
        elif levelled:
            text = f"GridLAB-D: {printable(levelled['text'].strip())}"
        else:
            continue
        (following if FOLLOWING.search(line) else found).append(text)
    found.sort(key=lambda text: text.startswith("GridLAB-D: "))  # those with a file and a line come first
    return list(dict.fromkeys(found or following))
