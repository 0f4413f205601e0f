"""`gridpeers predict`: what theory says of a scenario. What it needs is imported when it is used."""

from __future__ import annotations

from typing import Annotated

import typer

from gridpeers.cli.usage import BAD_INPUT, BROKEN, ScenarioName, chosen, fail, load, refuse, require


def predict(
    scenario: ScenarioName,
    case: Annotated[
        str | None, typer.Option(metavar="NAMES", help="Cases to predict, e.g. III,IV; all when left out.")
    ] = None,
    vars_: Annotated[
        bool, typer.Option("--vars/--no-vars", help="Modes of voltage and vars, which take a second or two.")
    ] = True,
) -> None:
    """Predict from theory how a scenario will go.

    That is modes, settling times, limits of step and delay, and times to restore after each event.
    Nothing is run but the plant on droop alone, to learn the load of each event and how vars answer to V_set.
    docs/theory.md has the equations, and how far they met the plant.

    Exit code: 0 all is well, 2 bad usage or a bad file, 3 the plant has no solution.

    Example:  gridpeers predict islanding --case IV
    """
    spec, feeder = load(scenario)
    spec = chosen(spec, case, None)
    require({"numba": "the plant", "scipy": "the theory", "threadpoolctl": "the plant"})

    from gridpeers.lab.predict.prediction import predictions
    from gridpeers.scenarios.run_request import BrokenRunError
    from gridpeers.scenarios.schema import ScenarioError

    if not feeder.inverters:
        fail([f"{scenario}: the feeder {feeder.name} has no inverters, so there is nothing to control"], BAD_INPUT)
    try:
        predicted = predictions(spec, feeder, voltage=vars_)
    except ScenarioError as error:
        refuse(error)
    except BrokenRunError as error:
        fail([str(error)], BROKEN)
    typer.echo("\n\n".join(map(str, predicted.values())))
