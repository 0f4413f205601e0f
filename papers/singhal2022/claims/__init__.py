"""What the paper claims of its experiments, one file per experiment."""

from gridpeers.benchmarks import Claim
from papers.singhal2022.claims.communication_claims import COMMUNICATION
from papers.singhal2022.claims.intermittency_claims import INTERMITTENCY
from papers.singhal2022.claims.islanding_claims import ISLANDING
from papers.singhal2022.claims.plug_n_play_claims import PLUG_N_PLAY
from papers.singhal2022.claims.switching_claims import SWITCHING
from papers.singhal2022.claims.topology_claims import TOPOLOGY
from papers.singhal2022.claims.wind_up_claims import WIND_UP

CLAIMS: dict[str, tuple[Claim, ...]] = {
    "islanding": ISLANDING,
    "intermittency": INTERMITTENCY,
    "communication": COMMUNICATION,
    "topology": TOPOLOGY,
    "plug-n-play": PLUG_N_PLAY,
    "switching": SWITCHING,
    "wind-up": WIND_UP,
}
"""Claims by experiment, named as in the scenario's key `paper`; the topologies are a sweep and have no scenario."""

__all__ = ["CLAIMS"]
