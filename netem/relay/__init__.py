"""A relay of Zenoh's own TCP and UDP traffic between two endpoints, which delays and loses it on the way.

Messages of the run are no longer the unit here: bytes of a connection and datagrams are late or lost, and the transport
does its part. `docs/netem.md` says which layer to use for what.
"""

from netem.relay.direction import Faults, FaultsError
from netem.relay.endpoint import Endpoint, EndpointError
from netem.relay.relay import Relay, RelayError
from netem.relay.relay_command import RelayCommandError

__all__ = ["Endpoint", "EndpointError", "Faults", "FaultsError", "Relay", "RelayCommandError", "RelayError"]
