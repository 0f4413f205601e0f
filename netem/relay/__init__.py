"""A relay of Zenoh's own TCP and UDP traffic between two endpoints, that hurts it on the way.

Messages of the run are no longer the unit here: what is late or lost are bytes of a connection and datagrams, and what
comes of that is up to the transport. `docs/netem.md` says which layer to use for what.
"""

from netem.relay.endpoint import Endpoint, EndpointError
from netem.relay.faults import Faults, FaultsError
from netem.relay.relay import Relay, RelayError
from netem.relay.relay_commands import WordError

__all__ = ["Endpoint", "EndpointError", "Faults", "FaultsError", "Relay", "RelayError", "WordError"]
