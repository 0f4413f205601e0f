"""The records of a run folder, while they grow, after their end, and cut off; and folders that have none."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path
from typing import Any

import msgspec
import pytest

from gridpeers.scenarios.record.record_file import RecordFileError
from gridpeers.scenarios.record.record_info import FILE
from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.viewer.record_pages import STILL, RecordedRun, RecordPage, RecordPages, RecordQuestion
from tests.record.recorded_runs import recorded_in_chunks

ISLANDED = """
[time]
end_s = 1.0
[[event]]
label = "event1"
t_s = 0.2
open = ["13-152"]
[case.case]
secondary = "all"
graph = "ring"
"""


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A record of 1 s, in several chunks."""
    return recorded_in_chunks(ISLANDED, tmp_path_factory.mktemp("record")).path


def grown_old(file: Path) -> None:
    """Make a file look as if nobody had written to it for long."""
    then = file.stat().st_mtime - 10 * STILL
    os.utime(file, (then, then))


def test_a_growing_record_is_followed(whole: Path, tmp_path: Path) -> None:
    """After each piece that is written, wherever it ends, the page shows what a record of that length has."""
    data, file = whole.read_bytes(), tmp_path / "case" / FILE
    file.parent.mkdir()
    shutil.copy(whole.parent / FILE, file)
    file.write_bytes(data[: len(data) // 3])
    run, known, decided, ends = RecordedRun(tmp_path), 0, 0, []
    for length in (*range(len(data) // 3, len(data), len(data) // 8), len(data)):
        file.write_bytes(data[:length])
        news = run.news("", known)
        known += len(news.events)
        view, fresh = run.view(), RunRecord.open(file)
        ends.append(news.t_end)

        assert news.growth == ("ended" if length == len(data) else "recording")
        assert (news.t_end, known, news.notes) == (fresh.t_end, len(fresh.events()), ())
        assert view.frame(news.t_end) == RecordedRun(tmp_path).view().frame(news.t_end)
        if any(True for _ in fresh.decisions("inv4")):
            decided += 1
            assert view.decision("inv4", news.t_end) == RecordedRun(tmp_path).view().decision("inv4", news.t_end)
    assert decided > 2
    assert ends == sorted(ends)
    assert ends[0] < ends[-1] == 1.0


def test_a_record_that_is_cut_off_says_so(whole: Path, tmp_path: Path) -> None:
    """It shows what there is; once it has not grown for a while it is no longer called a run that goes on."""
    data, file = whole.read_bytes(), tmp_path / FILE
    file.write_bytes(data[: len(data) // 2])
    run = RecordedRun(tmp_path)
    assert run.news("", 0).growth == "recording"

    grown_old(file)
    news = run.news("", 0)

    assert (news.growth, 0.0 < news.t_end < 1.0) == ("cut", True)
    assert news.text == "The record has no end: the run was killed, or is frozen."
    assert "The file is cut off within a " in news.notes[0]
    assert run.view().frame(news.t_end).inverters[0].P is not None


def test_rows_without_messages_leave_nobody_out(tmp_path: Path) -> None:
    """Journals come after the rows: at the end of a cut record agents are unknown, not gone; its page opens before."""
    longer = ISLANDED.replace("end_s = 1.0", "end_s = 4.0")
    data, file = recorded_in_chunks(longer, tmp_path).path.read_bytes(), tmp_path / FILE
    behind = 0
    for length in range(len(data) // 2, len(data), len(data) // 7):
        file.write_bytes(data[:length])
        view = RecordedRun(tmp_path).view()
        known, end = view.frame(view.known_end), view.frame(view.record.t_end)
        assert [one.note for one in known.inverters] == [one.note for one in end.inverters] == [""] * 9
        if view.known_end < view.record.t_end - 0.05:
            behind += 1
            assert all(known.links.values())
            assert not any(end.links.values())
    assert behind > 0


def test_the_latest_case_is_shown_until_another_is_chosen(whole: Path, tmp_path: Path) -> None:
    """A run with several cases has a record of each; a new one is found when it comes."""
    (tmp_path / "status.txt").write_text("running\n", encoding="utf-8")
    run = RecordedRun(tmp_path)
    with pytest.raises(RecordFileError, match="nothing is recorded yet"):
        run.news("", 0)

    for case in ("II", "I"):
        (tmp_path / case).mkdir()
        shutil.copy(whole, tmp_path / case)
        if case == "II":
            grown_old(tmp_path / case / FILE)
        assert run.news("", 0).case == case
    assert run.cases == ("II", "I")
    assert run.news("II", 0).case == "II"
    with pytest.raises(RecordFileError, match="no record of case III; there are II, I"):
        run.view("III")


def test_a_folder_without_a_record_is_one_sentence(whole: Path, tmp_path: Path) -> None:
    """Also a file of others, and a file that is not there."""
    (tmp_path / "none").mkdir()
    (tmp_path / "none" / "status.txt").write_text("complete\n", encoding="utf-8")
    (tmp_path / FILE).write_bytes(b"PK\x03\x04")
    for path, complaint in (
        (tmp_path / "none", "there is no run.mcap"),
        (tmp_path / FILE, "this is not a record"),
        (tmp_path / "gone", "cannot be read"),
    ):
        with pytest.raises(RecordFileError, match=complaint) as refused:
            RecordedRun(path)
        assert "\n" not in str(refused.value)


class Talk:
    """One page's side of the conversation, without a socket."""

    def __init__(self, pages: RecordPages) -> None:
        self._pages, self._page = pages, RecordPage()

    def news(self) -> dict[str, Any]:
        return self._merged(self._pages.news(self._page))

    def ask(self, **question: Any) -> dict[str, Any]:
        asked = msgspec.json.decode(json.dumps(question), type=RecordQuestion)
        return self._merged([*self._pages.frame(self._page, asked), *self._pages.decision(self._page, asked)])

    @staticmethod
    def _merged(texts: list[str]) -> dict[str, Any]:
        return {kind: of for text in texts for kind, of in json.loads(text).items()}


def test_pages_get_what_they_ask_for_and_no_more(whole: Path) -> None:
    """Two pages at their own times: links and points that a page has are not sent again, and a time is within."""
    pages = RecordPages(RecordedRun(whole))
    one, other = Talk(pages), Talk(pages)
    begun = one.news()
    assert begun["record"]["T_c"] == 0.02
    assert (begun["news"]["t_end"], len(begun["map"]["inverters"])) == (1.0, 10)
    assert "record" not in one.news()
    other.news()

    first = one.ask(at=0.5, agent="inv4")
    assert first["decision"]["ok"]
    assert first["decision"]["text"].startswith("inv4 at t = 0.50 s")
    assert first["decision"]["command"].endswith(f"why {whole.parent} inv4 0.5")
    assert len(first["frame"]["links"]) == 9
    later = one.ask(at=0.6, since=first["frame"]["points"][-1][0])["frame"]
    assert later.get("links", {}) == {}
    assert 0 < len(later["points"]) < 12 < len(first["frame"]["points"])
    assert len(other.ask(at=0.5)["frame"]["links"]) == 9
    assert other.ask(at=-3.0)["frame"]["t"] == 0.0
    assert other.ask(at=1e300)["frame"]["t"] == 1.0
    assert other.ask()["frame"]["t"] == 1.0

    refused = other.ask(at=0.5, agent="inv99")["decision"]
    assert not refused["ok"]
    assert refused["text"].startswith("there was no agent inv99")
    pages.close()
