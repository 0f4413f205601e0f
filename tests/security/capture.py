"""What passes on the loopback, as anybody with the right to listen there sees it: raw packets of one TCP port."""

from __future__ import annotations

import select
import socket
import struct
import threading
from types import TracebackType

from gridpeers.scenarios.drivers.free_endpoint import parse_endpoint

_ALL_PROTOCOLS = 0x0003
_ETHERNET = 14
"""Bytes of a frame's header."""


class CannotCaptureError(Exception):
    """Packets cannot be captured here; the message says why."""


class Capture:
    """Payloads of all packets on the loopback from and to the port of an endpoint. Use it as a context."""

    def __init__(self, endpoint: str) -> None:
        parsed = parse_endpoint(endpoint)
        assert parsed is not None
        self._port = parsed.port
        self.data = bytearray()
        """All payloads, one after the other."""
        try:
            self._socket = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(_ALL_PROTOCOLS))
        except (AttributeError, PermissionError) as error:
            raise CannotCaptureError(str(error)) from None
        self._socket.bind(("lo", 0))
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._read, daemon=True)

    def __enter__(self) -> Capture:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._ending.set()
        self._thread.join()
        self._socket.close()

    def _read(self) -> None:
        while not self._ending.is_set():
            if select.select([self._socket], [], [], 0.05)[0]:
                self.data += self._payload(self._socket.recv(65536 + _ETHERNET))

    def _payload(self, frame: bytes) -> bytes:
        """Return what a TCP segment over IPv4 carries, if it is from or to the port; else nothing."""
        packet = frame[_ETHERNET:]
        if len(packet) < 40 or packet[0] >> 4 != 4 or packet[9] != socket.IPPROTO_TCP:
            return b""
        header = 4 * (packet[0] & 0x0F)
        source, target = struct.unpack_from("!HH", packet, header)
        if self._port not in (source, target):
            return b""
        length = struct.unpack_from("!H", packet, 2)[0] or len(packet)
        return packet[header + 4 * (packet[header + 12] >> 4) : length]
