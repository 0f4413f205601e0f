"""Times to restore the frequency and to share power after an event, by theory.

All of it comes from `gridpeers.lab.predict.linear_model`, law and plant in discrete time, and is exact for that
model. Delays are in seconds and become control periods as in a simulated run: a state sent at t_k with delay d is used
from the first tick at or after t_k + d, and never before t_(k+1).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from gridpeers.lab.predict.closed_form import groups
from gridpeers.lab.predict.inverter_group import InverterGroup
from gridpeers.lab.predict.linear_model import LinkEnds, Loop, Path, Ticks
from gridpeers.scenarios.results.history import Flags, Floats
from gridpeers.scenarios.results.metrics import F_BAND, MPSI_BAND

HORIZON = 120.0


@dataclass(frozen=True, kw_only=True)
class LoadStep:
    start_pu: float = 0.647
    """Power of every inverter before the step, at nominal frequency (pu). The paper's start."""
    load_pu: float = 0.880
    islanding: bool = True
    """Whether the event creates the island. Then agents leave out states that were sent before it."""
    joining: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Times:
    """Times (s) after a step of load, by the bands of `gridpeers.scenarios.results.metrics`; None: above 120 s."""

    restore_s: float | None
    share_s: float | None
    stable: bool
    note: str = ""

    @property
    def report_s(self) -> float | None:
        both = self.restore_s, self.share_s
        return None if both[0] is None or both[1] is None else max(both[0], both[1])


def predicted_times(
    inverters: InverterGroup,
    *,
    link_delay_s: float | Mapping[LinkEnds, float] = 0.0,
    loss: float | Mapping[LinkEnds, float] = 0.0,
    load: LoadStep | None = None,
) -> Times:
    """Return the times to restore and to share after a step of the load, and whether the loop is stable.

    `link_delay_s`, `loss`: delay of states, and probability of losing one, where the last state is held; for all links,
    or by (src, dst). `load`: the paper's event 1 by default; `load_steps` has those of a scenario.
    """
    step = LoadStep() if load is None else load
    link: int | dict[LinkEnds, int]
    if isinstance(link_delay_s, Mapping):
        link = {ends: _in_ticks(delay, inverters.T_c) for ends, delay in link_delay_s.items()}
    else:
        link = _in_ticks(link_delay_s, inverters.T_c)
    loop = Loop(inverters=inverters, ticks=Ticks(link=link, loss=loss))
    if not loop.stable:
        return Times(restore_s=None, share_s=None, stable=False, note="unstable: oscillations grow")
    # until the slowest mode has fallen to 1e-5, at most HORIZON
    slowest = max(loop.spectral_radius, 1e-3)
    count = math.ceil(math.log(1e-5) / math.log(slowest)) + sum(loop.matrix.shape) // max(inverters.n, 1)
    count = min(max(count, round(2.0 / inverters.T_c)), round(HORIZON / inverters.T_c))
    nominal = step.load_pu * float(inverters.weight @ inverters.m_p)
    start = np.where([name in step.joining for name in inverters.names], 0.0, step.start_pu * inverters.m_p)
    path = loop.run(count, start, nominal, islanding=step.islanding)
    restore = _for_good(path.t, np.abs(path.e) * inverters.f_nom < F_BAND)
    share = _for_good(path.t, sharing_index(path, inverters) < MPSI_BAND)
    short = _beyond_limits(inverters, path)
    if short:
        return Times(restore_s=None, share_s=None, stable=True, note=short)
    return Times(restore_s=restore, share_s=share, stable=True, note=_note(inverters, restore, share))


def sharing_index(path: Path, inverters: InverterGroup) -> Floats:
    """Return MPSI of each tick, (16), over the inverters that have an agent; nan if none has one."""
    if not inverters.shares.any():
        return np.full(path.t.shape, np.nan)
    power, weight = path.power[:, inverters.shares], inverters.weight[inverters.shares]
    eta = power @ (weight / weight.sum())
    return np.asarray(np.mean(np.abs(power / eta[:, None] - 1.0), axis=1))


def _in_ticks(delay: float, T_c: float) -> int:
    """Return a delay (s) in control periods beyond the one that every state takes."""
    if not (math.isfinite(delay) and delay >= 0.0):
        raise ValueError(f"a delay must be 0 s or more, got {delay:g} s")
    return max(1, math.ceil(delay / T_c - 1e-9)) - 1


def _for_good(t: Floats, holds: Flags) -> float | None:
    failing = np.flatnonzero(~holds)
    first = 0 if failing.size == 0 else int(failing[-1]) + 1
    return None if first >= t.size else round(float(t[first]), 9)


def _beyond_limits(inverters: InverterGroup, path: Path) -> str:
    acts, s, gains = inverters.acts, inverters.s, inverters.gains
    if not acts.any():
        return ""
    highest = np.minimum(gains.P_set_max, [getattr(it, "P_max", math.inf) for it in inverters.parameters])
    needed = float((path.power[-1] / inverters.m_p * s)[acts].sum() / s[acts].sum())
    limit = float((highest * s)[acts].sum() / s[acts].sum())
    if needed <= limit:
        return ""
    return f"the inverters that run the law would need {needed:.2f} pu each, and their limit is {limit:.2f} pu"


def _note(inverters: InverterGroup, restore: float | None, share: float | None) -> str:
    if restore is not None and share is not None:
        return ""
    if not inverters.acts.any():
        return "no secondary control, so the error of the droop stays"
    if restore is None and not inverters.leads.any():
        return "no leader, so no agent corrects the frequency"
    idle, agents = int((inverters.shares & ~inverters.acts).sum()), int(inverters.shares.sum())
    if share is None and idle:
        return f"{idle} of {agents} inverters with an agent run no secondary law, and their power stays"
    if share is None and (parts := len(groups(inverters))) > 1:
        return f"the graph has {parts} unconnected groups, which do not agree on a share"
    return f"not within {HORIZON:g} s"
