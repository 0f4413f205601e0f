"""A man in the middle: passes the bytes of a TCP connection on, and keeps those of the one who connects."""

from __future__ import annotations

import contextlib
import socket
import threading
from types import TracebackType

from gridpeers.scenarios.drivers.free_endpoint import parse_endpoint


class Recording:
    """A relay before an endpoint. Use it as a context.

    Parameters
    ----------
    endpoint : str
        Where it passes bytes on to.
    """

    def __init__(self, endpoint: str) -> None:
        parsed = parse_endpoint(endpoint)
        assert parsed is not None
        self._target = parsed.host, parsed.port
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.endpoint = f"tls/127.0.0.1:{self._listener.getsockname()[1]}"
        """Where one connects."""
        self.bytes = bytearray()
        """What came from there."""
        self._sockets: list[socket.socket] = [self._listener]
        self._thread = threading.Thread(target=self._accept, daemon=True)

    def __enter__(self) -> Recording:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for each in self._sockets:
            with contextlib.suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
            each.close()

    def _accept(self) -> None:
        while True:
            try:
                near, _ = self._listener.accept()
            except OSError:
                return
            far = socket.create_connection(self._target)
            self._sockets += [near, far]
            for source, target, kept in ((near, far, True), (far, near, False)):
                threading.Thread(target=self._pass_on, args=(source, target, kept), daemon=True).start()

    def _pass_on(self, source: socket.socket, target: socket.socket, kept: bool) -> None:
        try:
            while data := source.recv(65536):
                if kept:
                    self.bytes += data
                target.sendall(data)
        except OSError:
            pass
