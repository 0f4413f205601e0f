"""Modes of a sampled signal by the matrix pencil method.

Hua and Sarkar, IEEE Trans. Acoustics, Speech, Signal Processing 38(5), 1990: a signal of M damped exponentials makes a
Hankel matrix of rank M, and its shift by one sample has their factors as generalised eigenvalues. Noise is what the
small singular values hold.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gridpeers.scenarios.results.history import Floats

RANK = 1e-3
"""Part of the largest singular value below which a singular value is noise, or of no account."""

MOST = 16
"""Most exponentials: eight oscillations, or fewer with a mean and a drift."""


class Mode(NamedTuple):
    """One oscillation of a signal."""

    f: float
    """Frequency (Hz)."""
    damping: float
    """Damping ratio: 0 lasts for ever, 1 does not swing, negative grows."""
    swing: float
    """Highest minus lowest value at the end of the signal, in its unit."""


def modes(x: Floats, dt: float) -> list[Mode]:
    r"""Return the oscillations in a signal, the largest at its end first.

    .. math:: x_k = \sum_m r_m z_m^k, \qquad s_m = \ln(z_m) / \Delta t, \qquad \zeta_m = -\Re(s_m) / |s_m|

    Parameters
    ----------
    x : Floats
        Samples, shape (N,), at least 8.
    dt : float
        Their distance (s).

    Examples
    --------
    >>> t = np.arange(100) * 0.02
    >>> (mode,) = modes(60.0 + 0.5 * np.exp(-0.3 * t) * np.cos(2 * np.pi * 1.5 * t), 0.02)
    >>> round(mode.f, 3), round(mode.damping, 3), round(mode.swing, 2)
    (1.5, 0.032, 0.55)
    """
    y = x - x.mean()
    count = len(y)
    if count < 8 or not np.ptp(y) > 0.0:
        return []
    length = count // 3
    hankel = np.lib.stride_tricks.sliding_window_view(y, length + 1)
    _, sizes, rows = np.linalg.svd(hankel, full_matrices=False)
    rank = min(int((sizes > RANK * sizes[0]).sum()), MOST, length)
    basis = rows[:rank].T
    z = np.linalg.eigvals(np.linalg.pinv(basis[:-1]) @ basis[1:])
    z = z[(np.abs(z) > 1e-6) & (np.abs(z) < 2.0)]
    powers = z[None, :] ** np.arange(count)[:, None]
    r = np.linalg.lstsq(powers, y.astype(complex), rcond=None)[0]
    found = []
    for pole, residue in zip(z, r, strict=True):
        s = np.log(pole) / dt
        if s.imag > 0.0:  # of each pair of conjugates, one
            size = np.abs(residue) * np.abs(pole) ** (count - 1)
            swing = (4.0 if np.abs(pole.imag) > 1e-9 * np.abs(pole) else 2.0) * float(size)  # at half the rate no pair
            found.append(Mode(f=float(s.imag / (2.0 * np.pi)), damping=float(-s.real / np.abs(s)), swing=swing))
    return sorted(found, key=lambda mode: -mode.swing)
