"""Error of a replay, or of what was asked of one."""

from __future__ import annotations


class ReplayError(ValueError):
    """A record that cannot be replayed, or a change that cannot be made to it; each problem is one sentence.

    Parameters
    ----------
    *problems : str
        The sentences.
    """

    def __init__(self, *problems: str) -> None:
        super().__init__("\n".join(problems))
        self.problems = problems
