"""The frequency of a bus as GridLAB-D measures it: a phase-locked loop on each phase, with the mean of the three."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

F_NOM = 60.0
K_P, K_I = 10.0, 100.0
"""Gains (rad/s per rad, rad/s^2 per rad): the defaults of GridLAB-D's nodes."""


class BusFrequency:
    """Three phase-locked loops that start locked at nominal frequency.

    Parameters
    ----------
    V
        Phasors of the bus at the start, in the frame of nominal frequency (V).
    h
        Step (s).
    """

    def __init__(self, V: NDArray[np.complex128], h: float) -> None:
        self._h, self._theta, self._w = h, np.angle(V), np.zeros(3)

    def measure(self, V: NDArray[np.complex128]) -> float:
        """Return the frequency (Hz) during a step, from the phasors (V) at the end of the step before."""
        error = np.imag(V * np.exp(-1j * self._theta)) / np.abs(V)
        w = K_P * error + self._w
        self._w = self._w + K_I * error * self._h
        self._theta = self._theta + w * self._h
        return float(F_NOM + w.mean() / (2.0 * np.pi))
