"""A sentence on the certificates that a scenario asks for, for `gridpeers check`."""

from __future__ import annotations

from collections.abc import Iterator

from gridpeers.plant.equipment import Feeder
from gridpeers.scenarios.schema.participants import inverters_of, without_agent
from gridpeers.scenarios.schema.scenario_model import ScenarioModel
from gridpeers.wire.driver.command_line import command_line


def security_notes(scenario: ScenarioModel, feeder: Feeder, file: str) -> Iterator[str]:
    """Yield how to run a scenario with `security = "mtls"`: which certificates it needs, and the commands.

    Parameters
    ----------
    scenario, feeder
        Checked.
    file : str
        As the scenario was named on the command line.
    """
    if scenario.security != "mtls":
        return
    lone = frozenset.intersection(*(without_agent(scenario, case) for case in scenario.cases))
    agents = [row.name for row in inverters_of(scenario, feeder) if row.name not in lone]
    yield (
        f'security = "mtls": processes need certificates: {command_line("keys", "init", "lab")}, then '
        f"{command_line('keys', 'issue', *agents, '--keys', 'lab')}, then "
        f"{command_line('run', file, '--keys', 'lab')} (docs/security.md); --driver inprocess needs none"
    )
