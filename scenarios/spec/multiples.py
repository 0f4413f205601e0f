"""Times that fall on the grid of a step; the mistake where they do not."""

from __future__ import annotations

from scenarios.spec.scenario_errors import Mistakes


def multiple(path: str, value: float, of: str, step: float, rule: str, mistakes: Mistakes) -> None:
    """Note a time (s) that is no whole multiple of a step (s).

    Parameters
    ----------
    path, of : str
        Keys of the time and of the step; with a mistake noted at either, or with one that is not above 0, nothing is.
    value, step : float
        Both (s).
    rule : str
        What takes place at such times, as an end of the sentence.
    mistakes : Mistakes
        Takes the mistake.
    """
    if mistakes.touch(path, of) or value <= 0 or step <= 0 or _whole(value / step):
        return
    near = f"{max(round(value / step), 1) * step:.9g}"
    key = of.rpartition(".")[2]
    mistakes.add(
        path, f"{value:g} s is not a multiple of {key} = {step:g} s{rule and f', {rule}'}; the nearest is {near}"
    )


def divides(path: str, step: float, of: str, value: float, mistakes: Mistakes) -> None:
    """Note a step (s) that does not divide a time (s); the fault is the step's."""
    if mistakes.touch(path, of) or value <= 0 or step <= 0 or _whole(value / step):
        return
    ratio = value / step
    key = of.rpartition(".")[2]
    # a step that can be written down in microseconds, for 0.02 / 7 cannot be typed
    whole = [n for n in range(1, 2 * round(ratio) + 2) if abs(round(value / n, 6) * n - value) < 1e-12]
    near = value / min(whole, key=lambda n: abs(n - ratio), default=1)
    mistakes.add(path, f"{step:g} s does not divide {key} = {value:g} s; the nearest that does is {near:g}")


def _whole(ratio: float) -> bool:
    """Whether it is 1, 2, 3, ...; the tolerance is that of decimal fractions in binary."""
    return round(ratio) >= 1 and abs(ratio - round(ratio)) <= 1e-6
