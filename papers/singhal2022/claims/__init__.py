"""The paper's claims on its experiments, one file per experiment."""

from gridpeers.benchmarks import Claim
from gridpeers.papers.singhal2022.claims import (
    communication_claims,
    intermittency_claims,
    islanding_claims,
    plug_n_play_claims,
    switching_claims,
    topology_claims,
    wind_up_claims,
)

CLAIMS: dict[str, tuple[Claim, ...]] = {
    "islanding": islanding_claims.claims.all,
    "intermittency": intermittency_claims.claims.all,
    "communication": communication_claims.claims.all,
    "topology": topology_claims.claims.all,
    "plug-n-play": plug_n_play_claims.claims.all,
    "switching": switching_claims.claims.all,
    "wind-up": wind_up_claims.claims.all,
}
"""Claims by experiment, named as in the scenario's key `paper`; the topologies are a sweep and have no scenario."""

__all__ = ["CLAIMS"]
