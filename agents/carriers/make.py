"""From the choice of a law to the law itself, and its end."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol, runtime_checkable

from gridpeers.agents.agent_config import Control, LawChoice
from gridpeers.agents.carriers.law_registry import LAWS
from gridpeers.agents.carriers.time_limit import make_limited
from gridpeers.agents.laws.in_force import law_in_force
from gridpeers.agents.laws.law import Law


@runtime_checkable
class Asked(Protocol):
    """A law that is asked to end before it is waited for."""

    def end_input(self) -> None:
        """Ask it."""
        ...


def make_law(control: Control) -> Law:
    """Return the law of one inverter.

    Raises
    ------
    ValueError
        If there is no such law, or it cannot be made with these parameters; the text says what would be right.
    """
    choice = control.law
    if choice.command:
        from gridpeers.agents.carriers.program import ProgramLaw

        return ProgramLaw(choice)
    if choice.fmu:
        from gridpeers.agents.carriers.fmu import FmuLaw

        return FmuLaw(choice)
    if choice.use == LawChoice().use:
        return law_in_force(control)
    law = LAWS.resolve(choice.use, choice.folder)
    try:
        return make_limited(law, choice.parameters, choice.time_limit)
    except ValueError as error:
        raise ValueError(f"law {choice.use} {error}") from error


def close_laws(laws: Iterable[Law]) -> None:
    """End some laws; programs are all asked before the first is waited for."""
    ended = tuple(laws)
    for law in ended:
        if isinstance(law, Asked):
            law.end_input()
    for law in ended:
        law.close()
