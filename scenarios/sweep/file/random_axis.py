"""Keys drawn at random: uniform, log-uniform or by choice, as a Latin hypercube or independently."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gridpeers.scenarios.schema.scenario_errors import Problems
from gridpeers.scenarios.sweep.file.axes import Axis, Setting, is_number, of_values
from gridpeers.scenarios.sweep.file.paths import flatten
from gridpeers.scenarios.sweep.file.sweep_model import RandomAxis
from gridpeers.wire.schema.suggestion import suggestion

DISTRIBUTIONS = ("uniform", "loguniform", "choice")


@dataclass(frozen=True)
class Distribution:
    """How one key is drawn."""

    name: str
    """One of `DISTRIBUTIONS`."""
    of: Sequence[Any]
    """Bounds, or the choices."""

    def at(self, u: float) -> Any:
        """Return the quantile at a number u from [0, 1).

        Examples
        --------
        >>> uniform, loguniform = Distribution("uniform", [1.0, 3.0]), Distribution("loguniform", [0.01, 1.0])
        >>> uniform.at(0.5), loguniform.at(0.5), Distribution("choice", "ab").at(0.6)
        (2.0, 0.1, 'b')
        """
        if self.name == "choice":
            return self.of[int(u * len(self.of))]
        low, high = self.of
        raw = low + (high - low) * u if self.name == "uniform" else low * (high / low) ** u
        return float(f"{raw:.12g}")

    def problem(self) -> str:
        """Return the problem of the bounds or the choices; "" if there is none."""
        of = self.of
        if self.name == "choice":
            return "" if isinstance(of, list) and of else f"choice needs a list of values, got {of!r}"
        if not (isinstance(of, list) and len(of) == 2 and all(map(is_number, of)) and of[0] < of[1]):
            return f"{self.name} needs [low, high], two numbers in this order, got {of!r}"
        if self.name == "loguniform" and of[0] <= 0:
            return f"loguniform needs bounds above 0, got {of!r}; or use uniform"
        return ""


def random_axes(axis: RandomAxis, problems: Problems) -> list[Axis]:
    """Return the one axis of the keys of `[random.keys]`, which are drawn together, or none."""
    keys = {path: _distribution(path, value, problems) for path, value in flatten(axis.keys, _is_distribution)}
    if keys and not axis.samples and not problems.touch("random.samples"):
        problems.add("random.samples", "no sample is drawn; write how many, e.g. samples = 100")
    elif axis.samples and not keys:
        problems.add("random", "samples are asked for, but no key is drawn; write a table [random.keys]")
    return [Axis({path: f"random.keys.{path}" for path in keys}, lambda: draw(axis, keys))] if keys else []


def draw(axis: RandomAxis, keys: Mapping[str, Distribution]) -> Sequence[Setting]:
    """Draw the samples: `scipy.stats.qmc.LatinHypercube`, or independent uniform numbers.

    Examples
    --------
    >>> drawn = draw(RandomAxis(samples=4), {"gains.alpha": Distribution("uniform", [0.0, 4.0])})
    >>> sorted(int(setting.put["gains.alpha"]) for setting in drawn)
    [0, 1, 2, 3]
    """
    if axis.method == "latin-hypercube":
        from scipy.stats import qmc  # takes longer to import than a run takes

        unit = qmc.LatinHypercube(len(keys), rng=axis.seed).random(axis.samples)
    else:
        unit = np.random.default_rng(axis.seed).random((axis.samples, len(keys)))
    columns = zip(keys.items(), unit.T.tolist(), strict=True)
    return of_values({path: [distribution.at(u) for u in column] for (path, distribution), column in columns})


def _distribution(path: str, value: Any, problems: Problems) -> Distribution:
    """Return the distribution of a key, of use only when no problem is noted."""
    name, of = next(iter(value.items()), ("", ())) if isinstance(value, Mapping) else ("", ())
    if name not in DISTRIBUTIONS or len(value) != 1:
        wrong = next((key for key in value if key not in DISTRIBUTIONS), "") if isinstance(value, Mapping) else ""
        hint = f"the distributions are {', '.join(DISTRIBUTIONS)}"
        hint = suggestion(wrong, DISTRIBUTIONS, "distributions") if wrong else hint
        text = f"must be one distribution such as {{ uniform = [0.5, 2.0] }}, got {value!r}; {hint}"
    else:
        text = Distribution(name, of).problem()
    if text:
        problems.add(f"random.keys.{path}", text)
    return Distribution(name, of)


def _is_distribution(table: Mapping[str, Any]) -> bool:
    return not any(isinstance(below, Mapping) for below in table.values())
