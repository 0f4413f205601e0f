"""Part (f): random feeders beside OpenDSS, at the start, after a load step, and after a switching."""

from __future__ import annotations

import tempfile
from functools import partial
from pathlib import Path
from typing import get_args

import numpy as np

from bench.validation.opendss.opendss_engines import ENGINES, SolvedStates, solve_scripts
from bench.validation.random_feeders.feeder_states import FeederStates, run_states
from bench.validation.random_feeders.random_script import Shape, random_feeder
from bench.validation.validation_part import CaseResult, ToleranceCheck, ValidationPart
from plant.dynamics import PlantError
from plant.tables import FeederError

LIMIT = 1e-6
"""Largest difference of a phasor (pu of nominal voltage), and largest current that is left at a node (A)."""

ALL, IN_TESTS = 250, 12
"""Feeders of a case."""

CASES = {"radial": f"{ALL} radial feeders", "meshed": f"{ALL} feeders with meshes"}


def _run(case: str, count: int = ALL) -> CaseResult:
    shape = next(shape for shape in get_args(Shape) if shape == case)
    with tempfile.TemporaryDirectory() as folder:
        scripts, found, refused = list[Path](), list[FeederStates](), list[Path]()
        for seed in range(count):
            drawn, script = random_feeder(seed, shape), Path(folder) / f"{case}{seed}.dss"
            script.write_text(drawn.script, encoding="utf-8")
            try:
                found.append(run_states(drawn, script, dense=seed % 4 == 3))
                scripts.append(script)
            except (FeederError, PlantError, ArithmeticError):
                refused.append(script)
        checks = list[ToleranceCheck]()
        falsely = set[Path]()
        for engine in ENGINES:
            theirs = solve_scripts(engine, [(script, s.commands) for script, s in zip(scripts, found, strict=True)])
            largest = float(np.max([_largest(*pair) for pair in zip(found, theirs, strict=True)]))
            checks.append(ToleranceCheck(f"V, pu, {engine}", largest, LIMIT))
            plain = solve_scripts(engine, [(script, [()]) for script in refused])
            falsely |= {script for script, each in zip(refused, plain, strict=True) if np.isfinite(each.V).all()}
    checks += [
        ToleranceCheck("start, pu, `solve_power_flow`", max(states.start for states in found), LIMIT),
        ToleranceCheck("current left, A", max(states.residual for states in found), LIMIT),
        ToleranceCheck("refused, but solved by an engine", float(len(falsely)), 0.0),
    ]
    facts = {
        "feeders": str(count),
        "refused": str(len(refused)),
        "asymmetric": str(sum(states.asymmetry > 1e-3 for states in found)),
        "with an island": str(sum(states.islanded > 0 for states in found)),
        "nodes": str(sum(len(states.names) for states in found)),
    }
    return CaseResult(case, tuple(checks), facts)


def _largest(ours: FeederStates, theirs: SolvedStates) -> float:
    """Return the largest difference (pu) at any node of the engine in any state; nan where it found none."""
    at = [ours.names.index(name) for name in theirs.nodes]
    gaps = [np.abs(V[at] - theirs.V[k]) / ours.V_nom[at] for k, V in enumerate(ours.V)]
    return float(np.max(gaps))


RANDOM_FEEDERS = ValidationPart("random-feeders", ENGINES, CASES, _run, partial(_run, count=IN_TESTS))
