"""Hosts on one machine: network namespaces, each with an address of its own, on one switch whose ports can be cut."""

from __future__ import annotations

import os
import shutil
import subprocess
from types import TracebackType


class NoHostsError(Exception):
    """Namespaces cannot be made here; the message says why."""


class Hosts:
    """Network namespaces on a bridge. Use it as a context."""

    def __init__(self, count: int) -> None:
        self._count = count
        self._stem = f"gp{os.getpid()}"

    def __enter__(self) -> Hosts:
        if shutil.which("ip") is None:
            raise NoHostsError("there is no command ip")
        try:
            self._ip("netns", "add", self._switch)
            self._ip("-n", self._switch, "link", "add", "br0", "type", "bridge")
            self._ip("-n", self._switch, "link", "set", "br0", "up")
            for host in self._all:
                self._ip("netns", "add", self._name(host))
                far = ("peer", "name", "eth0", "netns", self._name(host))
                self._ip("-n", self._switch, "link", "add", self._port(host), "type", "veth", *far)
                self._ip("-n", self._switch, "link", "set", self._port(host), "master", "br0", "up")
                self._ip("-n", self._name(host), "address", "add", f"{self.address(host)}/24", "dev", "eth0")
                self._ip("-n", self._name(host), "link", "set", "eth0", "up")
                self._ip("-n", self._name(host), "link", "set", "lo", "up")
        except NoHostsError:
            self._remove()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._remove()

    def address(self, host: int) -> str:
        """IPv4 address of a host."""
        return f"10.77.0.{host}"

    def at(self, host: int) -> list[str]:
        """Prefix of a command that runs it on a host."""
        return ["ip", "netns", "exec", self._name(host)]

    def cut(self, host: int) -> None:
        """Cut a host off: its port on the switch goes down, and nobody is told."""
        self._ip("-n", self._switch, "link", "set", self._port(host), "nomaster")

    def heal(self, host: int) -> None:
        self._ip("-n", self._switch, "link", "set", self._port(host), "master", "br0")

    @property
    def _all(self) -> range:
        return range(1, self._count + 1)

    @property
    def _switch(self) -> str:
        return f"{self._stem}sw"

    def _name(self, host: int) -> str:
        return f"{self._stem}h{host}"

    def _port(self, host: int) -> str:
        return f"port{host}"

    def _ip(self, *words: str) -> None:
        done = subprocess.run(["ip", *words], capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise NoHostsError(f"ip {' '.join(words)}: {done.stderr.strip()}")

    def _remove(self) -> None:
        for name in (*map(self._name, self._all), self._switch):
            subprocess.run(["ip", "netns", "delete", name], capture_output=True, check=False)
