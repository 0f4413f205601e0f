"""A bounded part of ``python -m tests.fuzz``: a million made-up messages to all that takes bytes; what it has found."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import msgspec
import pytest

from gridpeers.scenarios.emulation.link_data import LinkCommand, decode_statuses
from gridpeers.scenarios.live.feeder_map import read_feeder_map
from gridpeers.scenarios.live.run_requests import read_config
from gridpeers.scenarios.results.run_files import JOURNAL, FolderError, rows_in
from gridpeers.scenarios.sweep.sweep_case import SweepRow
from gridpeers.wire.codec import KINDS
from gridpeers.wire.trust.key_folder import KeysError, read_list
from gridpeers.wire.trust.site_authority import make_site
from tests.fuzz.__main__ import fuzz
from tests.fuzz.receivers import receivers


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


def test_no_name_from_outside_can_write_on_a_terminal(tmp_path: Path) -> None:
    """Errors repeat it: of a receiver's links, a command to links, and, as msgspec does, an unknown field of a list."""
    for statuses in ({"inv2": {"holds": ["\x1b[2Jall is well"]}}, {"\x1b[2J": {"holds": []}}):
        with pytest.raises(msgspec.DecodeError):
            decode_statuses(msgspec.msgpack.encode(statuses))
    with pytest.raises(ValueError, match=r"unknown field `\\x1b\[2J`"):
        LinkCommand.of_tree({"\x1b[2J": 1})
    make_site(tmp_path / "lab")
    listed = tmp_path / "lab" / "members.json"
    data = listed.read_bytes()
    for whole, broken in ((b'"generation"', b'"generatio\\u001b"'), (b'"site"', b'"\\u001b[2J"')):
        assert whole in data
        listed.write_bytes(data.replace(whole, broken, 1))
        with pytest.raises(KeysError) as caught:
            read_list(tmp_path / "lab")
        assert str(caught.value).isprintable()


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
