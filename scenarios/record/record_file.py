"""Read the file of a record up to its end or its first damaged chunk, without trusting anything in it; and find it.

The file is a sequence of MCAP records, each with its length before it. A process that is killed leaves the last one
half written, and no index at the end. So the reader does not use the index: it goes from record to record up to the
end, and on from there later, if the run is still recorded.
"""

from __future__ import annotations

import struct
from collections.abc import Collection, Iterator
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, NamedTuple

import msgspec
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Chunk, Header, Message, Metadata
from mcap.stream_reader import breakup_chunk

from gridpeers.scenarios.record.record_info import FILE, FORMAT, METADATA, PROFILE, TOPICS, RecordInfo, Topic
from gridpeers.wire.codec import decode_foreign
from gridpeers.wire.wording import InputError, suggestion

_MAGIC = bytes((137, 77, 67, 65, 80, 48, 13, 10))
_FRAME = struct.Struct("<BQ")
_TIMES = struct.Struct("<QQ")
_FOOTER = 20  # Bytes of the record that ends a file
_TOPICS = dict(enumerate(TOPICS.values(), 1))  # By channel, as our writer numbers them

_BROKEN = (
    McapError, struct.error, ValueError, KeyError, OverflowError, MemoryError, zstandard.ZstdError, RuntimeError,
)  # fmt: skip
"""What the MCAP library and its decompressors raise over bytes that are none of theirs."""


class RecordFileError(InputError):
    """A record that cannot be read, or does not have what was asked for; one sentence says why and what to do."""


class RecordMessage(NamedTuple):
    topic: Topic
    t: int
    """Run time at which its sender published it (ns)."""
    number: int
    data: bytes


class RecordFile:
    """The file of one record, opened.

    Raise RecordFileError if it is missing, no record of ours, or from a later version.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.complete = False
        """True if the file was closed properly: everything that was recorded is in it."""
        self._end = ""
        self.damaged = False
        """True once a damaged chunk was met: the file ends there then."""
        self._offset = 0
        """Where the first record begins that could not be read yet."""
        self._chunks: list[tuple[int, int]] = []
        """Place and length (bytes) of each chunk."""
        self.ends: list[float] = []
        """Latest run time (s) up to the end of each part that can be read on its own, in the order of the file."""
        self._info: RecordInfo | None = None
        self.refresh()
        if self._info is None:
            raise RecordFileError(f"{path}: the file ends before its description of the run: {self._size} bytes")
        self.info: RecordInfo = self._info

    @property
    def damage(self) -> tuple[str, ...]:
        """A sentence on where it ends if it is cut off, or where a damaged chunk was met; nothing behind it is read."""
        return (self._end,) if self._end else ()

    @property
    def t_end(self) -> float:
        return self.ends[-1] if self.ends else 0.0

    def messages(self, topics: Collection[Topic] | None = None) -> Iterator[RecordMessage]:
        """Yield the messages of these topics, or all, in the order of the file; one part is in memory at a time."""
        for index in range(len(self.ends)):
            yield from (message for message in self.part(index) if topics is None or message.topic in topics)

    def part(self, index: int) -> tuple[RecordMessage, ...]:
        """Return the messages of a part; none if it is damaged, or behind a damaged one: the file ends there then."""
        if index >= len(self.ends):
            return ()
        place, length = self._chunks[index]
        try:
            with self.path.open("rb") as file:
                file.seek(place)
                data = file.read(length)
            records = breakup_chunk(Chunk.read(ReadDataStream(BytesIO(data))), validate_crc=True)
        except OSError as error:
            raise RecordFileError(f"{self.path}: cannot be read: {error.strerror}") from None
        except _BROKEN as error:
            del self.ends[index:], self._chunks[index:]
            self.damaged, self.complete = True, False
            why = str(error)[:100] or type(error).__name__
            self._end = f"the file is damaged after t = {self.t_end:.2f} s, and read up to there: {why}"
            return ()
        messages = []
        for record in records:
            if isinstance(record, Message) and record.channel_id in _TOPICS:
                topic = _TOPICS[record.channel_id]
                messages.append(RecordMessage(topic, record.log_time, record.sequence, record.data))
        return tuple(messages)

    def refresh(self) -> None:
        if self.damaged:
            return
        try:
            with self.path.open("rb") as file:
                self._size = file.seek(0, 2)
                file.seek(self._offset)
                if not self._offset and file.read(len(_MAGIC)) != _MAGIC:
                    raise RecordFileError(
                        f"{self.path}: this is not a record: it does not begin as an MCAP file; give a {FILE}"
                    )
                self._offset = file.tell()
                if not self.complete:
                    self._end = self._scan(file)
        except OSError as error:
            raise RecordFileError(f"{self.path}: cannot be read: {error.strerror}") from None

    def _scan(self, file: BinaryIO) -> str:
        """Note the places of chunks from here on; return how the file ends if it is cut off, or ""."""
        while frame := file.read(_FRAME.size):
            if len(frame) < _FRAME.size:
                return self._cut("within the length of a record")
            opcode, length = _FRAME.unpack(frame)
            start = file.tell()
            if start + length > self._size:
                return self._cut("within a chunk" if opcode == Opcode.CHUNK else "within a record")
            if opcode == Opcode.FOOTER and length == _FOOTER:
                self.complete = True
                return ""
            if opcode == Opcode.CHUNK and length > _TIMES.size:
                _, until = _TIMES.unpack(file.read(_TIMES.size))
                self._chunks.append((start, length))
                self.ends.append(max(self.t_end, until / 1e9))  # a part may have late messages alone
            elif opcode == Opcode.HEADER:
                self._check_header(file.read(length))
            elif opcode == Opcode.METADATA:
                self._info = self._info or self._info_of(file.read(length))
            self._offset = start + length
            file.seek(self._offset)
        return self._cut("between two chunks")

    def _cut(self, where: str) -> str:
        at = f" after t = {self.t_end:.2f} s" if self.ends else ""
        return f"the file is cut off {where}{at}: its writer was killed, or is still at work"

    def _check_header(self, data: bytes) -> None:
        try:
            profile = Header.read(ReadDataStream(BytesIO(data))).profile
        except _BROKEN:
            profile = ""
        if profile != PROFILE:
            raise RecordFileError(
                f"{self.path}: an MCAP file, but not a record of gridpeers: its profile is {profile!r:.42}"
            )

    def _info_of(self, data: bytes) -> RecordInfo | None:
        try:
            metadata = Metadata.read(ReadDataStream(BytesIO(data)))
            if metadata.name != METADATA:
                return None
            version = int(metadata.metadata["format"])
        except _BROKEN:
            return None
        by = metadata.metadata.get("gridpeers", "") or "unknown"
        if version > FORMAT:
            raise RecordFileError(
                f"{self.path}: a record of format {version}, written by gridpeers {by[:40]}; this one reads up to "
                f"{FORMAT}: install the later gridpeers"
            )
        try:
            info = metadata.metadata["info"].replace('"clock":"wall"', '"clock":"realtime"')  # until November 2026
            return decode_foreign(msgspec.json.Decoder(RecordInfo).decode, info)
        except (KeyError, msgspec.MsgspecError) as error:
            raise RecordFileError(
                f"{self.path}: its description of the run (written by gridpeers {by[:40]}) cannot be read: {error}"
            ) from None


def record_path(path: str | Path, case: str = "") -> Path:
    """Return the file of a record, of the folder of a case or of a run; it may not be there.

    Raise RecordFileError if the folder has no record, none of that case, or those of several cases and none is chosen.
    """
    first, *others = records_in(Path(path), case)
    if others:
        cases = ", ".join(file.parent.name for file in (first, *others))
        raise RecordFileError(
            f"{path}: it has a record of each case, {cases}; choose one with --case {first.parent.name}, "
            f"or give its folder, {first.parent}"
        )
    return first


def records_in(path: Path, case: str = "") -> tuple[Path, ...]:
    """Return the files of the records of a run, of all its cases or of one; see `record_path`."""
    if not path.exists():
        return (path,)
    if path.is_file() or (path / FILE).exists():
        file = path if path.is_file() else path / FILE
        if case and case != file.resolve().parent.name:
            raise RecordFileError(
                f'{path}: it is the record of one case, and "{case}" is another one; leave --case out'
            )
        return (file,)
    found = {file.parent.name: file for file in sorted(path.glob(f"*/{FILE}"))}
    if not found:
        raise RecordFileError(
            f"{path}: there is no {FILE}: the run was not recorded, or this is not the folder of a run"
        )
    if case and case not in found:
        raise RecordFileError(f'{path}: no record of case "{case}"; {suggestion(case, found, "cases")}')
    return (found[case],) if case else tuple(found.values())
