"""Keys drawn at random: uniform, log-uniform or by choice, as a Latin hypercube or independently."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from scenarios.schema.scenario_errors import Problems
from scenarios.sweep.file.axes import Axis, is_number, of_values
from scenarios.sweep.file.paths import flatten
from scenarios.sweep.file.sweep_model import RandomAxis
from wire.suggestion import suggestion

LAWS = ("uniform", "loguniform", "choice")


@dataclass(frozen=True)
class Law:
    """How one key is drawn."""

    name: str
    """One of `LAWS`."""
    of: Sequence[Any]
    """Bounds, or what is chosen from."""

    def at(self, u: float) -> Any:
        """Value for a number that is uniform in [0, 1): the law's quantile.

        Examples
        --------
        >>> Law("uniform", [1.0, 3.0]).at(0.5), Law("loguniform", [0.01, 1.0]).at(0.5), Law("choice", "ab").at(0.6)
        (2.0, 0.1, 'b')
        """
        if self.name == "choice":
            return self.of[int(u * len(self.of))]
        low, high = self.of
        raw = low + (high - low) * u if self.name == "uniform" else low * (high / low) ** u
        return float(f"{raw:.12g}")


def laws_of(axis: RandomAxis, problems: Problems) -> dict[str, Law]:
    """Law of each key of `[random.keys]`, problems noted."""
    found = {}
    for path, value in flatten(
        axis.keys, lambda value: not any(isinstance(below, Mapping) for below in value.values())
    ):
        at = f"random.keys.{path}"
        if not isinstance(value, Mapping) or len(value) != 1 or next(iter(value)) not in LAWS:
            wrong = next((key for key in value if key not in LAWS), "") if isinstance(value, Mapping) else ""
            hint = suggestion(wrong, LAWS, "laws") if wrong else f"the laws are {', '.join(LAWS)}"
            problems.add(at, f"must be one law such as {{ uniform = [0.5, 2.0] }}, got {value!r}; {hint}")
            continue
        ((name, of),) = value.items()
        if name == "choice":
            if not isinstance(of, list) or not of:
                problems.add(at, f"choice needs a list of values, got {of!r}")
                continue
        elif not (isinstance(of, list) and len(of) == 2 and all(map(is_number, of)) and of[0] < of[1]):
            problems.add(at, f"{name} needs [low, high], two numbers in this order, got {of!r}")
            continue
        elif name == "loguniform" and of[0] <= 0:
            problems.add(at, f"loguniform needs bounds above 0, got {of!r}; or use uniform")
            continue
        found[path] = Law(name, of)
    return found


def check_random(axis: RandomAxis, problems: Problems) -> None:
    """Samples and keys come together."""
    if axis.keys and not axis.samples and not problems.touch("random.samples"):
        problems.add("random.samples", "no sample is drawn; write how many, e.g. samples = 100")
    elif axis.samples and not axis.keys:
        problems.add("random", "samples are asked for, but no key is drawn; write a table [random.keys]")


def of_laws(axis: RandomAxis, laws: Mapping[str, Law]) -> Axis:
    """Draw the samples: `scipy.stats.qmc.LatinHypercube`, or independent uniform numbers.

    Examples
    --------
    >>> drawn = of_laws(RandomAxis(samples=4), {"gains.alpha": Law("uniform", [0.0, 4.0])})
    >>> sorted(int(setting.put["gains.alpha"]) for setting in drawn)
    [0, 1, 2, 3]
    """
    if axis.method == "latin-hypercube":
        from scipy.stats import qmc  # takes longer to import than a run takes

        unit = qmc.LatinHypercube(len(laws), rng=axis.seed).random(axis.samples)
    else:
        unit = np.random.default_rng(axis.seed).random((axis.samples, len(laws)))
    columns = zip(laws.items(), unit.T.tolist(), strict=True)
    return of_values({path: [law.at(u) for u in column] for (path, law), column in columns})
