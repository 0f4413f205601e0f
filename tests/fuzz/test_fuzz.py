"""A bounded part of ``python -m tests.fuzz``: a million made-up messages to all that takes bytes; what it has found."""

from __future__ import annotations

import random
import subprocess
import sys
from pathlib import Path

import msgspec
import pytest

from gridpeers.scenarios.emulation.link_data import LinkCommand, decode_statuses
from gridpeers.scenarios.live.feeder_map import read_feeder_map
from gridpeers.scenarios.live.run_requests import read_config
from gridpeers.scenarios.record.journal_reader import entries_of, values_of
from gridpeers.scenarios.results.run_files import JOURNAL, FolderError, rows_in
from gridpeers.scenarios.sweep.sweep_case import SweepRow
from gridpeers.wire.codec import KINDS
from gridpeers.wire.messages import LONGEST_MESSAGE
from gridpeers.wire.trust.key_folder import KeysError, read_list
from gridpeers.wire.trust.site_authority import issue, make_site
from tests.fuzz import fuzzing
from tests.fuzz.fuzzing import FuzzError, fuzz
from tests.fuzz.mutation import Mutation
from tests.fuzz.receivers import receivers
from tests.hostile.cases import sealed


def test_no_bytes_raise_an_error_that_nobody_expects(tmp_path: Path) -> None:
    """Random, changed, cut, nested and misaddressed ones: each is used, or refused by its kind."""
    outcomes, ways = fuzz(1_500)
    kinds = {kind for name, kind in outcomes if name == "codec"}

    assert min(ways.values()) > 15
    assert {"", "corrupt", "garbled", "unknown", "implausible", "oversized"} - kinds <= {"oversized"}
    assert {name for name, _ in outcomes} == set(receivers())
    for name in {name for name, _ in outcomes}:
        assert sum(count for (to, kind), count in outcomes.items() if to == name and kind) > 30, name
    assert {kind for name, kind in outcomes if "agent" in name or "plant" in name} <= {"", *KINDS} - {"failed"}


def test_an_error_is_told_with_the_bytes_that_raised_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """A receiver that fails ends the fuzzing with number, seed and bytes of the message, so that it can be repeated."""

    class Weak:
        def take(self, payload: bytes, rng: random.Random) -> str:
            return str(payload[40])

    monkeypatch.setattr(fuzzing, "receivers", lambda: {"codec": Weak(), "weak": Weak()})
    with pytest.raises(FuzzError, match=r"message \d+ of seed 5 \(.*\), codec: IndexError: .*; b'"):
        fuzz(1_000, seed=5)


def test_a_seed_makes_the_same_messages() -> None:
    """So what was found once is found again."""
    first, again, other = Mutation(3), Mutation(3), Mutation(4)
    made = [first.make() for _ in range(200)]

    assert made == [again.make() for _ in range(200)]
    assert made != [other.make() for _ in range(200)]


LIST_AS_KEY = b"\x81\x91\x01\x01"


def test_a_map_with_a_list_as_key_is_no_message_and_no_journal() -> None:
    """Python has no such map: msgpack raises a TypeError."""
    assert values_of(sealed(LIST_AS_KEY)) == {}
    with pytest.raises(ValueError, match="an entry is none of ours"):
        list(entries_of(LIST_AS_KEY))


def test_a_journal_longer_than_a_message_is_refused_before_it_is_read() -> None:
    """The buffer of msgpack would overflow with an error of its own."""
    with pytest.raises(ValueError, match=f"{LONGEST_MESSAGE + 1} bytes"):
        list(entries_of(bytes(LONGEST_MESSAGE + 1)))


@pytest.mark.parametrize("statuses", [{"inv2": {"holds": ["\x1b[2Jall is well"]}}, {"\x1b[2J": {"holds": []}}])
def test_the_state_of_a_link_cannot_write_on_a_terminal(statuses: dict[str, object]) -> None:
    """`gridpeers link show` prints what a receiver says of its links, and of whose they are."""
    with pytest.raises(msgspec.DecodeError):
        decode_statuses(msgspec.msgpack.encode(statuses))


@pytest.mark.parametrize(
    ("whole", "broken"),
    [(b'"generation"', b'"generatio\\u001b"'), (b'"site"', b'"\\u001b[2J"')],
)
def test_a_list_of_members_cannot_write_on_a_terminal(whole: bytes, broken: bytes, tmp_path: Path) -> None:
    """Msgspec repeats the name of a field that it does not know, as it stands in the file."""
    make_site(tmp_path / "lab")
    issue(tmp_path / "lab", "inv1")
    listed = tmp_path / "lab" / "members.json"
    data = listed.read_bytes()
    assert whole in data
    listed.write_bytes(data.replace(whole, broken, 1))

    with pytest.raises(KeysError) as caught:
        read_list(tmp_path / "lab")
    assert str(caught.value).isprintable()


def test_a_command_to_links_cannot_write_on_a_terminal() -> None:
    """Its refusal repeats a name as well, and goes back to the client and into the log."""
    with pytest.raises(ValueError, match=r"unknown field `\\x1b\[2J`"):
        LinkCommand.of_tree({"\x1b[2J": 1})


DEEP = b'{"x": ' + b"[" * 2000
"""Brackets so deep that msgspec raises a RecursionError, in a field that nobody knows and that is passed over."""


def test_brackets_a_thousand_deep_are_refused_like_anything_else(tmp_path: Path) -> None:
    """In the journal of a study, in what an agent or a plant answers, in what a process reads of its configuration."""
    (tmp_path / JOURNAL).write_bytes(DEEP + b"\n")
    with pytest.raises(FolderError, match=r"runs\.jsonl:1: this line is damaged"):
        rows_in(tmp_path, SweepRow)
    assert read_config(DEEP) is None
    assert read_feeder_map(DEEP) is None
    done = subprocess.run([sys.executable, "-m", "gridpeers.agents"], input=DEEP, capture_output=True, check=False)
    assert (done.returncode, b"Traceback" in done.stderr) == (2, False), done.stderr
