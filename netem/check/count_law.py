r"""Exact law of a count along a Markov chain: how many messages are lost, or how many bursts begin.

A counter is a chain with marked steps. With A(z) = plain + z marked, the law of the number K of marked steps among n
has the generating function

.. math:: E[z^K] = v\, A(z)^n\, 1

which is evaluated at the M-th roots of unity and turned back by an FFT. That gives P(K = k mod M), which is the law
itself where M is more than the range of K.

The normal approximation is no substitute: with p = 0.0005 and r = 0.25 (`lte`) 450 messages see one burst in four runs
or five, and a single burst of ten messages is eleven standard deviations off.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from netem.models.chain import RESTART
from netem.models.loss import LossModel

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

Run = tuple[int, int]
"""Messages in a row: the distance of the first from the message before it, or from the chain's start; and how many."""

Block = tuple[Run, ...]
"""Runs of messages between two starts of the chain; see `netem.models.chain`."""

_POINTS = 4096
"""Roots of unity that are done at once: it bounds the memory."""

_WIDTHS = 40.0
"""Standard deviations, and times that the chain needs to forget, on either side of the mean: the law is given there."""


class Counter(NamedTuple):
    """A count along a loss model's chain. State of the counter: the chain's state and the fate of the last message."""

    hidden: Array
    """Transitions of the model's chain, states x states."""
    stationary: Array
    """Law of the chain where it starts."""
    enter: Array
    """From the chain's state at the first message of a run to the counter's: 2 x states x counter's states, the second
    of the two with the marked steps."""
    step: Array
    """From message to message of a run, in the same way: 2 x counter's states x counter's states."""
    leave: Array
    """From the counter's state to the chain's, counter's states x states."""


def losses(model: LossModel) -> Counter:
    """Return the counter of lost messages."""
    P, pi, loss = _chain(model)
    lost, kept = np.diag(loss), np.diag(1.0 - loss)
    return Counter(P, pi, np.stack([kept, lost]), np.stack([P @ kept, P @ lost]), np.eye(len(pi)))


def bursts(model: LossModel, *, single: bool) -> Counter:
    """Return the counter of bursts whose beginning was seen; if `single`, of those of one message, seen whole.

    Fate of the last message: 0 it came, 1 it was the first of a burst, 2 a later one, or one that a run begins with.
    """
    P, pi, loss = _chain(model)
    lost, kept, nothing = np.diag(loss), np.diag(1.0 - loss), np.zeros_like(P)
    enter = np.stack([np.hstack([kept, nothing, lost]), np.zeros((len(pi), 3 * len(pi)))])
    begins, comes_after_one = P @ lost, P @ kept
    plain = np.block(
        [
            [P @ kept, begins if single else nothing, nothing],
            [nothing if single else comes_after_one, nothing, P @ lost],
            [P @ kept, nothing, P @ lost],
        ]
    )
    marked = np.block(
        [
            [nothing, nothing if single else begins, nothing],
            [comes_after_one if single else nothing, nothing, nothing],
            [nothing, nothing, nothing],
        ]
    )
    counter = Counter(P, pi, enter, np.stack([plain, marked]), np.vstack([np.eye(len(pi))] * 3))
    return _reachable(counter)


def _chain(model: LossModel) -> tuple[Array, Array, Array]:
    return np.array(model.transitions), np.array(model.stationary), np.array(model.loss_in_state)


def _reachable(counter: Counter) -> Counter:
    """Return the counter without the states that are never reached."""
    into = counter.enter.sum(axis=(0, 1)) + counter.step.sum(axis=(0, 1))
    there = np.flatnonzero(into > 0.0)
    return counter._replace(
        enter=counter.enter[:, :, there], step=counter.step[:, there][:, :, there], leave=counter.leave[there]
    )


def blocks(seq: npt.NDArray[np.int64]) -> tuple[Block, ...]:
    """Return numbers of messages, ascending, as runs without a gap, none across a start of the chain."""
    blocks_so_far: list[Block] = []
    runs: list[Run] = []
    block, after = -1, 0
    for run in np.split(seq, np.flatnonzero((np.diff(seq) != 1) | (seq[1:] % RESTART == 0)) + 1):
        if not len(run):
            continue
        if run[0] // RESTART != block:
            blocks_so_far += [tuple(runs)] if runs else []
            block, runs, after = int(run[0]) // RESTART, [], int(run[0])
        runs.append((int(run[0]) - after, len(run)))
        after = int(run[-1])
    return (*blocks_so_far, tuple(runs)) if runs else tuple(blocks_so_far)


@lru_cache(maxsize=256)
def law(counted: str, model: LossModel, parts: tuple[Block, ...]) -> tuple[int, Array]:
    """Return the exact law of a count over some messages.

    Parameters
    ----------
    counted : str
        One of `COUNTED`.
    model : LossModel
        The chain.
    parts : tuple[Block, ...]
        Which messages; see `blocks`.

    Returns
    -------
    tuple[int, Array]
        A number, and the probabilities of it and of those that follow. The rest sums to less than 1e-12.
    """
    counter = COUNTED[counted](model)
    n = sum(length for block in parts for _, length in block)
    times = {block: parts.count(block) for block in set(parts)}
    first, size = _window(counter, times, n)
    roots = np.exp(2j * np.pi * np.arange(size // 2 + 1) / size)
    transform = np.concatenate(
        [_generating(counter, times, roots[i : i + _POINTS]) for i in range(0, len(roots), _POINTS)]
    )
    probabilities = np.fft.irfft(transform.conj(), size)
    return first, np.maximum(np.roll(probabilities, -(first % size)), 0.0)


def tail(count: int, first: int, probabilities: Array) -> float:
    """Return the probability of a count as far out as this one: twice the smaller side, so never too small."""
    at = count - first
    if not 0 <= at < len(probabilities):
        return 0.0
    return float(min(1.0, 2.0 * min(probabilities[: at + 1].sum(), probabilities[at:].sum())))


def mean(first: int, probabilities: Array) -> float:
    """Return the mean of a law."""
    return float((first + np.arange(len(probabilities))) @ probabilities)


def _window(counter: Counter, times: dict[Block, int], n: int) -> tuple[int, int]:
    """Return the first count of the law and their number: all, or those within `_WIDTHS` of the mean."""
    angle = 0.1 / n
    (near_one,) = np.log(_generating(counter, times, np.exp(1j * np.array([angle]))))
    centre, deviation = near_one.imag / angle, np.sqrt(max(-2.0 * near_one.real, 0.0)) / angle
    kept = sorted(np.abs(np.linalg.eigvals(counter.hidden)))[:-1]
    forgets = min(1.0 / (1.0 - kept[-1]), RESTART) if kept and kept[-1] < 1.0 else RESTART if kept else 1.0
    size = int(2.0 * _WIDTHS * (deviation + forgets)) + 2
    if size > n:
        return 0, n + 1
    return min(max(round(centre) - size // 2, 0), n + 1 - size), size


def _generating(counter: Counter, times: dict[Block, int], z: Complex) -> Complex:
    """Return E[z^K] at several z."""
    at = z[:, None, None]
    enter = counter.enter[0] + at * counter.enter[1]
    powers = [counter.step[0] + at * counter.step[1]]
    product = np.ones(len(z), dtype=np.complex128)
    for block, count in times.items():
        state = np.broadcast_to(counter.stationary.astype(np.complex128), (len(z), 1, len(counter.stationary)))
        for number, (distance, length) in enumerate(block):
            if number:
                state = state @ counter.leave @ np.linalg.matrix_power(counter.hidden, distance)
            state = state @ enter
            for bit in range((length - 1).bit_length()):
                if bit == len(powers):
                    powers.append(powers[-1] @ powers[-1])
                if (length - 1) >> bit & 1:
                    state = state @ powers[bit]
        product *= state.sum(axis=(1, 2)) ** count
    return product


COUNTED: dict[str, Callable[[LossModel], Counter]] = {
    "losses": losses,
    "bursts": lambda model: bursts(model, single=False),
    "single": lambda model: bursts(model, single=True),
}
"""Counts: messages lost, bursts whose beginning was seen, bursts of one message, seen whole."""
