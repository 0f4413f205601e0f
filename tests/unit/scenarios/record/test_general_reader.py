"""A general reader of MCAP files, as viewers have one, finds its way in a record without any code of ours."""

from __future__ import annotations

import json
from pathlib import Path
from typing import BinaryIO

import jsonschema
import msgpack
import pytest
from mcap.reader import McapReader, make_reader

from tests.record.recorded_runs import recorded_in_chunks

LOSSY = """
seed = 7
[time]
end_s = 1.0
[[event]]
label = "event1"
t_s = 0.2
open = ["13-152"]
[case.case]
secondary = "all"
graph = "full"
[[link]]
on = "inv1 -> *"
loss = 0.2
"""

TOPICS = {
    "telemetry": ("msgpack", "gridpeers.Telemetry"),
    "journal": ("msgpack", "gridpeers.Journal"),
    "link_reports": ("msgpack", "gridpeers.LinkReport"),
    "link_requests": ("msgpack", "gridpeers.LinkRequest"),
    "physics": ("json", "gridpeers.Physics"),
    "events": ("json", "foxglove.Log"),
}


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A record with an islanding and a lossy link, in several chunks."""
    return recorded_in_chunks(LOSSY, tmp_path_factory.mktemp("general")).path


def opened(file: BinaryIO) -> McapReader:
    """The library's reader, which checks each chunk."""
    return make_reader(file, validate_crcs=True)


def test_channels_and_schemas_are_those_that_docs_name(path: Path) -> None:
    """Each channel has its encoding and a JSON schema that is one; the file says who wrote it and what ran."""
    with path.open("rb") as file:
        reader = opened(file)
        summary = reader.get_summary()
        assert summary is not None
        channels = {
            channel.topic: (channel.message_encoding, summary.schemas[channel.schema_id])
            for channel in summary.channels.values()
        }
        header, metadata = reader.get_header(), {record.name: record.metadata for record in reader.iter_metadata()}

    assert {topic: (encoding, schema.name) for topic, (encoding, schema) in channels.items()} == TOPICS
    for _, schema in channels.values():
        assert schema.encoding == "jsonschema"
        jsonschema.Draft202012Validator.check_schema(json.loads(schema.data))
    assert (header.profile, header.library) == ("gridpeers", "gridpeers 0.1.0")
    assert metadata["gridpeers"]["case"] == "case"
    assert json.loads(metadata["gridpeers"]["info"])["seed"] == 7


def test_the_index_leads_to_every_message_in_the_order_of_time(path: Path) -> None:
    """By the index there are as many messages as the statistics say, and a window of time has those that are in it."""
    with path.open("rb") as file:
        reader = opened(file)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        messages = [message for _, _, message in reader.iter_messages()]
        times = [message.log_time for message in messages]
        inside = [message for _, _, message in reader.iter_messages(starting_at=300_000_000, ending_before=700_000_000)]
        physics = [message for _, _, message in reader.iter_messages(topics=["physics"])]

    assert len(summary.chunk_indexes) > 2
    assert len(messages) == summary.statistics.message_count
    assert times == sorted(times)
    assert (times[0], times[-1]) == (0, 10**9)
    assert (summary.statistics.message_start_time, summary.statistics.message_end_time) == (0, 10**9)
    assert inside == [message for message in messages if 300_000_000 <= message.log_time < 700_000_000]
    assert [message.log_time for message in physics] == [200_000_000 * k for k in range(6)]


def test_each_message_is_as_its_schema_says(path: Path) -> None:
    """JSON by the schema of its channel, so that a viewer can plot it; msgpack of the type that the schema names."""
    count = 0
    with path.open("rb") as file:
        for schema, channel, message in opened(file).iter_messages():
            assert schema is not None
            if channel.message_encoding == "json":
                content = json.loads(message.data)
                jsonschema.validate(content, json.loads(schema.data))
                if channel.topic == "physics":
                    assert content["inv4"]["f_Hz"] == pytest.approx(60.0, abs=1.0)
                    assert round(content["t_s"] * 1e9) == message.log_time
            else:
                content = msgpack.unpackb(message.data[:-4])
                assert f"gridpeers.{content['type']}" == schema.name
                assert content["seq"] == message.sequence
            count += 1

    assert count > 30
