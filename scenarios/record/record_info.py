"""The head of a record: version of the format, scenario, configurations and versions; and the topics of records."""

from __future__ import annotations

from contextlib import suppress
from typing import Literal

import msgspec

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.scenarios.emulation.link_data import EmulationConfig
from gridpeers.wire.journal import RecordLevel
from gridpeers.wire.messages import Journal, LinkReport, LinkRequest, Measurement, State, Telemetry

FILE = "run.mcap"

FORMAT = 2
"""Version of the format. A reader refuses a record of a later one; a new kind of entry or message does not raise it.
Since 2 events have what became of switches and loads as numbers, not in words alone."""

PROFILE = "gridpeers"  # Profile in the header of the file, by which a record of ours is known
METADATA = "gridpeers"  # Name of the metadata record with the `RecordInfo`


LIVE: Literal["live"] = "live"  # The driver of a live run, as files name it


class RecordInfo(msgspec.Struct, frozen=True, kw_only=True):
    format: int = FORMAT
    level: RecordLevel
    scenario: str
    case: str
    """Name of the case; empty in a live run without a scenario."""
    toml: str
    """The scenario as run, as TOML; empty in a live run without a scenario."""
    seed: int
    driver: Literal["inprocess", "processes", "live"]
    versions: dict[str, str]
    inverters: tuple[str, ...]
    plant: PlantConfig
    agents: tuple[AgentConfig, ...]
    """Configuration of each agent, also of those that join later."""
    fields: dict[str, tuple[str, ...]] = msgspec.field(
        default_factory=lambda: {kind.__name__: kind.__struct_fields__ for kind in (Measurement, State)}
    )
    """Fields of the messages that journals have as lists of values."""
    started: str = ""
    """Date and time at which a run in real time was started, with its time zone; empty in simulated time, where the
    record does not depend on it."""

    @property
    def run(self) -> str:
        return self.plant.run

    @property
    def clock(self) -> Literal["simulated", "realtime"]:
        return self.plant.clock

    @property
    def simulated(self) -> bool:
        return self.clock == "simulated"

    @property
    def agent_names(self) -> tuple[str, ...]:
        return tuple(config.name for config in self.agents)

    @property
    def T_c(self) -> float:
        return self.plant.T_c

    @property
    def emulation(self) -> EmulationConfig | None:
        """The planned faults of links and nodes, from the first configuration that can be read; None without any."""
        for tree in filter(None, (self.plant.links, *(config.links for config in self.agents))):
            with suppress(msgspec.ValidationError):  # of a later version
                return EmulationConfig.of_tree(tree)
        return None

    def agent(self, name: str) -> AgentConfig | None:
        return next((config for config in self.agents if config.name == name), None)

    def to_metadata(self) -> dict[str, str]:
        """Return the metadata of the file: all as JSON, and what a reader of another version looks at."""
        by = self.versions.get("gridpeers", "")
        return {"format": str(self.format), "info": msgspec.json.encode(self).decode(), "gridpeers": by}


Topic = Literal["telemetry", "journal", "link_reports", "link_requests"]

TOPICS: dict[type[Telemetry] | type[Journal] | type[LinkReport] | type[LinkRequest], Topic] = {
    Telemetry: "telemetry",
    Journal: "journal",
    LinkReport: "link_reports",
    LinkRequest: "link_requests",
}
"""Topic of each message that the plant publishes for recorders. Their payloads are in the record as they were sent."""
