"""The paper's experiments, each case run once for all tests of this folder and for the pinned histories."""

from dataclasses import dataclass
from functools import cache

from gridpeers.papers.singhal2022.paper_benchmarks import CLAIMS
from gridpeers.scenarios.checks.checked_case import CheckedCase
from gridpeers.scenarios.results.claims import judge
from gridpeers.scenarios.results.findings import Findings, SteadyValues, find
from gridpeers.scenarios.results.history import History, Nameplates
from gridpeers.scenarios.schema import load_scenario
from tests.golden.catalogue.pins import ran


@dataclass(frozen=True)
class Experiment:
    """Results of all cases of one scenario."""

    nameplates: Nameplates
    histories: dict[str, History]
    found: Findings

    @property
    def steady(self) -> SteadyValues:
        return self.found.results

    def statuses(self, experiment: str) -> dict[str, str]:
        """Verdict on each claim of an experiment, by its name."""
        return {verdict.claim.name: verdict.status for verdict in judge(self.found, CLAIMS[experiment])}


def expected(experiment: str) -> dict[str, str]:
    """The documentation's word on each claim: it holds, or is a known miss."""
    return {claim.name: "MISS" if claim.known_miss else "PASS" for claim in CLAIMS[experiment]}


@cache
def experiment(name: str) -> Experiment:
    scenario, feeder = load_scenario(name)
    nameplates = Nameplates.of(feeder.inverters)
    cases = {}
    for case in scenario.cases:
        recorded, outcome = ran(name, case)
        assert not outcome.broke
        assert outcome.reproducible
        assert recorded.inverters == nameplates.names
        cases[case] = CheckedCase.of(scenario, feeder, case, recorded)
    found = find(cases)
    return Experiment(nameplates, {case: record.history for case, record in cases.items()}, found)
