"""How many inverters each section between switches has, in groups of a leader and its followers."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil

GROUP = 3
"""Inverters of a group, a microgrid of its own: one leader and its followers. A section has one group or several."""
GROUP_LOAD = 2e6
"""Load (W) beyond which a section has more groups: one leader does not hold the ends of a long feeder."""
MOST_GROUPS = 12
"""Groups that are proposed without being told how many inverters, those of most load first."""


def group_sizes(loads: Sequence[float], places: Sequence[int], count: int | None) -> list[list[int]]:
    """Return the sizes of the groups of the first sections; with `count` there are so many inverters, if they fit.

    Parameters
    ----------
    loads
        Load of each section (W), in falling order.
    places
        Inverters for which each has a bus, one or more.
    count
        Inverters, or None for as many as the load needs.
    """
    whole = ceil(count / GROUP) if count else MOST_GROUPS
    number = [1 for _ in loads[:whole]]

    def most_loaded(room: Sequence[int]) -> int | None:
        return max(
            (k for k, most in enumerate(room) if number[k] < most), key=lambda k: loads[k] / number[k], default=None
        )

    while sum(number) < whole:  # the next group goes where a group has most load
        k = most_loaded([many // GROUP for many in places[: len(number)]])
        if k is None or (count is None and loads[k] / number[k] <= GROUP_LOAD):
            break
        number[k] += 1
    while count and sum(min(many, GROUP * groups) for many, groups in zip(places, number, strict=False)) < count:
        k = most_loaded([ceil(many / GROUP) for many in places[: len(number)]])  # others have too few buses
        if k is not None:
            number[k] += 1
        elif len(number) < len(loads):
            number.append(1)
        else:
            break
    sizes = [[0] * many for many in number]
    for _ in range(count or GROUP * sum(number)):
        open_ = [group for group, many in zip(sizes, places, strict=False) if sum(group) < many and min(group) < GROUP]
        if open_:
            smallest = min(open_, key=min)
            smallest[smallest.index(min(smallest))] += 1
    return [[size for size in group if size] for group in sizes]
