"""What the paper claims of its experiments: one shape of claim, one file per experiment, one way to judge."""

from scenarios.results.claims.claim import Claim, Verdict, judge
from scenarios.results.claims.communication import COMMUNICATION
from scenarios.results.claims.intermittency import INTERMITTENCY
from scenarios.results.claims.islanding import ISLANDING
from scenarios.results.claims.plug_n_play import PLUG_N_PLAY
from scenarios.results.claims.switching import SWITCHING
from scenarios.results.claims.topology import TOPOLOGY
from scenarios.results.claims.wind_up import WIND_UP

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

__all__ = ["CLAIMS", "Claim", "Verdict", "judge"]
