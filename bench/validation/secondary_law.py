"""GridLAB-D's secondary frequency control (`sec_control`): one controller for the island, as its source defines it.

From the frequency f at its bus and the powers P_i of its participants it forms the error (MW)

    e = B (f_nom - f) - sum_i (P_set,i - P_i),

f within a dead band giving no error of frequency. At every sample, T apart, an integrator with anti-windup takes

    x' = k_i e - (1 - u) y,

u being 1 where the output is published and f outside of the dead band, else 0, and y the integrator's value at the
sample before. At every publication, T_s apart, participant i's set-point is moved by alpha_i x, within its limits. Like
everything in GridLAB-D's delta mode it acts in both passes of a step, as predictor and as corrector (Heun).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple


class Participant(NamedTuple):
    """An inverter or a machine whose set-point is moved."""

    share: float
    """alpha: its share of the output."""
    P_rated: float
    """Rating (MW), base of its per-unit values."""
    P_set0: float
    """Set-point at the start (pu)."""
    P_min: float = 0.0
    """Least set-point (pu)."""
    P_max: float = 1.0
    """Largest set-point (pu), and largest distance from the start."""


class SecondarySettings(NamedTuple):
    """The settings of the autotest."""

    f_nom: float = 60.0
    """Hz."""
    dead_band: float = 0.001
    """Hz, to either side."""
    bias: float = 12.1187
    """B (MW/Hz)."""
    k_i: float = 0.04
    """Of the integrator (1/s)."""
    T: float = 0.1
    """Between two samples of the frequency (s)."""
    T_s: float = 0.2
    """Between two publications, and two samples of the powers (s)."""


AUTOTEST = SecondarySettings()


class SecondaryControl:
    """The controller between two steps.

    `start` is GridLAB-D's clock at the first step (s): when a sample is due is decided by rounding at this magnitude.
    `offsets` tell how far each participant's set-point is moved (pu).
    """

    def __init__(
        self, participants: Mapping[str, Participant], start: float, settings: SecondarySettings = AUTOTEST
    ) -> None:
        self._participants, self._settings = participants, settings
        self._next_sample, self._next_publication = start + settings.T, start + settings.T_s
        self.offsets = dict.fromkeys(participants, 0.0)
        self._moved = dict.fromkeys(participants, 0.0)
        self._integral = self._slope = self._shortfall = 0.0
        self._sampling = self._publishing = False

    def predict(self, end: float, f: float, P: Mapping[str, float]) -> None:
        """Act in the first pass of the step that ends at `end` (s), from the frequency (Hz) and the powers (MW)."""
        self._sampling, self._publishing = end >= self._next_sample, end >= self._next_publication
        self._next_sample += self._settings.T if self._sampling else 0.0
        self._next_publication += self._settings.T_s if self._publishing else 0.0
        if self._sampling:
            self._slope, publish = self._evaluate(f, P)
            self._move(self._integral + self._settings.T * self._slope, publish, second=False)

    def correct(self, f: float, P: Mapping[str, float]) -> None:
        """Act in the second pass of the same step."""
        if self._sampling:
            slope, publish = self._evaluate(f, P)
            self._integral += self._settings.T / 2.0 * (self._slope + slope)
            self._move(self._integral, publish, second=True)

    def _evaluate(self, f: float, P: Mapping[str, float]) -> tuple[float, bool]:
        """Return the integrator's slope (MW/s), and whether its value is published."""
        settings = self._settings
        error = settings.f_nom - f
        outside = abs(error) > settings.dead_band
        if self._publishing:
            self._shortfall = sum(
                (each.P_set0 + self.offsets[name]) * each.P_rated - P[name] for name, each in self._participants.items()
            )
        publish = self._publishing and outside
        slope = settings.k_i * (settings.bias * (error if outside else 0.0) - self._shortfall)
        return slope - (0.0 if publish else self._integral), publish

    def _move(self, x: float, publish: bool, *, second: bool) -> None:
        """Move the set-points by x (MW) in all; the second pass replaces what the first did."""
        for name, each in self._participants.items():
            wanted = each.share * x / each.P_rated if publish else 0.0
            before = self.offsets[name]
            after = before + wanted - (self._moved[name] if second else 0.0)
            after = min(max(after, -each.P_max), each.P_max)
            after = min(max(after, each.P_min - each.P_set0), each.P_max - each.P_set0)
            self.offsets[name], self._moved[name] = after, after - before
