"""From the choice of a law to the law itself."""

from __future__ import annotations

from agents.carriers.registry import LAWS
from agents.carriers.time_limit import TimeLimited
from agents.config import Control, LawChoice
from agents.laws.call import ANYTHING
from agents.laws.in_force import law_in_force
from agents.laws.law import Law


def make_law(control: Control) -> Law:
    """Return the law of one inverter.

    Raises
    ------
    ValueError
        If there is no such law, or it cannot be made with these parameters; the text says what would be right.
    """
    choice = control.law
    if choice.command:
        from agents.carriers.program import ProgramLaw

        return ProgramLaw(choice)
    if choice.fmu:
        from agents.carriers.fmu import FmuLaw

        return FmuLaw(choice)
    if choice.use == LawChoice().use:
        return law_in_force(control)
    law = LAWS.resolve(choice.use, choice.folder)
    try:
        return TimeLimited(law(**choice.parameters), choice.time_limit)
    except ValueError as error:
        raise ValueError(f"law {choice.use}: {error}") from error
    except ANYTHING as error:  # its __init__ is anybody's code
        raise ValueError(f"law {choice.use} cannot be made: {type(error).__name__}: {error}") from error
