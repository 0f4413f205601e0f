"""Why a command finds no plant: nobody listens, no certificate is accepted, nothing passes, or it is another run's."""

from __future__ import annotations

from collections.abc import Collection

from gridpeers.scenarios.drivers.free_endpoint import loopback_fault, parse_endpoint
from gridpeers.scenarios.live.client.access import is_loopback_host
from gridpeers.scenarios.live.client.run_address import PROBE, RunAddress, accepting
from gridpeers.wire.driver.command_line import command_line
from gridpeers.wire.driver.session import Session
from gridpeers.wire.messages import PLANT
from gridpeers.wire.trust.tls_refusal import tls_refusal


class PlantSearch:
    """The search of one session for the plant of a run.

    Parameters
    ----------
    where : RunAddress
        The run and its endpoints.
    session : Session
        The session.
    """

    def __init__(self, where: RunAddress, session: Session) -> None:
        self._where, self._session = where, session
        self._told: set[str] = set()
        self._strangers: list[str] = []
        """Lines on links to ends without access. The session gives each once; the error at the end needs them too."""

    def refused(self) -> str:
        """Return why no link will come, if every endpoint refuses one; else the empty string."""
        if self._session.peers():
            return ""
        refusals = [_refusal(text, self._where) for text in self._where.connect]
        return "\n".join(refusals) if all(refusals) else ""

    def news(self, runs: Collection[str]) -> list[str]:
        """Return what is wrong with links that are there, each sentence once.

        Parameters
        ----------
        runs : Collection[str]
            Names of the runs whose plants have been heard of.
        """
        lines = [line for line in self._faults(runs) if line not in self._told]
        self._told.update(lines)
        return lines

    def _faults(self, runs: Collection[str]) -> list[str]:
        credentials = self._where.credentials
        if credentials is None:
            return []
        vouched = self._session.vouches(PLANT)  # first: it looks at links that have just come, and notes their lines
        self._strangers += self._session.take_lines()
        if runs or not vouched:
            return [*self._strangers]
        own = credentials.own
        return [
            *self._strangers,
            f"the plant at {self._at} takes the link, but nothing passes on it: it is still being built, or its "
            f"members.json revokes or lacks the certificate of {own.name}, which its output says; gridpeers keys issue "
            f"{own.name} --role {own.role}, where the site was made, gives {own.name} a new one",
        ]

    def failure(self, wait: float, runs: Collection[str], others: Collection[str]) -> str:
        """Return why no plant was found.

        Parameters
        ----------
        wait : float
            How long the search took (s).
        runs, others : Collection[str]
            Names of the runs whose plants have been heard of, and those of them that were not sought.
        """
        if not self._session.peers():
            return self.refused() or self._no_link(wait)
        there = f"runs there: {', '.join(sorted(others))}" if others else ""
        if faults := self._faults(runs):
            beside = f" ({there})" if there else ""
            return f"no plant of {self._where} within {wait:g} s{beside}: {'; '.join(faults)}"
        start = command_line("plant", "SCENARIO", "--run", self._where.run, *self._where.access.words)
        return (
            f"no plant of {self._where} within {wait:g} s ({there or 'no other run is there either'}); start one "
            f"({start}), or give another name by --run"
        )

    @property
    def _at(self) -> str:
        return ", ".join(self._where.connect)

    def _no_link(self, wait: float) -> str:
        where = self._where
        mute = accepting(where.connect)
        if mute and where.credentials is not None:
            return (
                f"something listens at {', '.join(mute)} and has made no link within {wait:g} s: it is of a run "
                "without certificates, no plant, or a frozen one, which kill -CONT lets go on; say by --connect where "
                "the plant is"
            )
        if mute:
            return (
                f"something listens at {', '.join(mute)} but has said nothing within {wait:g} s; if it is a frozen "
                "plant, kill -CONT lets it go on, else end it by its process id; if it is something else, say by "
                "--connect where the plant is; a plant with certificates asks for --keys DIR and tls/..."
            )
        return (
            f"nothing answers at {self._at} within {wait:g} s; start a plant there "
            f"({command_line('plant', 'SCENARIO', *where.access.words)}), or say by --connect where it is"
        )


def _refusal(text: str, where: RunAddress) -> str:
    """Return why an endpoint and this process make no link; empty if they may."""
    endpoint = parse_endpoint(text)
    if endpoint is None or not endpoint.connects:
        return ""
    if is_loopback_host(endpoint.host) and (fault := loopback_fault()):
        return f"nothing can be reached at {text}: {fault}"
    refusal = tls_refusal(endpoint.host.strip("[]"), endpoint.port, where.credentials, PROBE)
    if not refusal:
        return ""
    if where.credentials is None:
        advice = f"say --keys DIR and {endpoint._replace(protocol='tls')}"
    else:
        advice = "say by --keys the folder of its site, or by --connect where the plant of this site is"
    return f"what listens at {text} {refusal}; {advice} (docs/security.md)"
