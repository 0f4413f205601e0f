"""A fork server: it imports what many processes need, once, and forks each of them.

    python -m gridpeers.wire.driver.fork_server SOCKET MODULE ...

`SOCKET` is the number of an inherited Unix socket, where the requests of `gridpeers.scenarios.drivers.forking` arrive.
Each `MODULE` is imported at the start; of `MODULE:FUNCTION` the function is called too. Then each request, the words of
a command line (`agents`, `--leash`, `inv1`) as JSON and three open files, becomes a process that runs the module as
`python -m` would: with these as its standard input, output and error, in a session of its own.

The server forks twice and the process between ends at once, so that the new process becomes a child of the one that
asks, the next subreaper above (`prctl(2)`). Forking is safe here: the server has one thread, which it checks, and no
session.
"""

from __future__ import annotations

import ctypes
import gc
import json
import os
import runpy
import socket
import sys
from importlib import import_module
from pathlib import Path

LONGEST = 65_536  # Longest request (bytes)


def main() -> None:
    """Import, then serve requests until the socket closes; in a new process, run its module."""
    control = socket.socket(fileno=int(sys.argv[1]))
    for text in sys.argv[2:]:
        module, _, function = text.partition(":")
        found = import_module(module)
        if function:
            getattr(found, function)()
    gc.collect()
    gc.freeze()  # no collection touches these objects, so that the processes share their memory
    job = _serve(control)
    if job is None:
        return
    control.close()
    _become(*job)
    module = job[0][0]
    if not hasattr(sys.modules.get(module), "__path__"):
        sys.modules.pop(module, None)  # runpy warns of a module that it runs and that is there already
    runpy.run_module(module, run_name="__main__", alter_sys=True)


def _serve(control: socket.socket) -> tuple[list[str], list[int]] | None:
    """In a new process return its module with the arguments, and its three standard files.

    Return None in the server, once nobody asks any more.
    """
    while True:
        data, files, _, _ = socket.recv_fds(control, LONGEST, 3)
        if not data:
            return None
        answer: dict[str, object]
        if (threads := len([*Path("/proc/self/task").iterdir()])) > 1:
            answer = {"error": f"the fork server has {threads} threads: what was imported has started some"}
        else:
            forked = _fork_twice()
            if forked is None:
                return json.loads(data), files
            answer = {"pid": forked}
        for file in files:
            os.close(file)
        control.sendall(json.dumps(answer).encode())


def _fork_twice() -> int | None:
    """Fork a process that has the next subreaper above as its parent; return its id, None in the process itself."""
    reading, writing = os.pipe()
    between = os.fork()
    if between == 0:
        if pid := os.fork():
            os.write(writing, str(pid).encode())
            os._exit(0)
        os.close(reading)
        os.close(writing)
        return None
    os.waitpid(between, 0)  # from now on the new process has its new parent
    os.close(writing)
    pid = int(os.read(reading, 20))
    os.close(reading)
    return pid


def _become(words: list[str], files: list[int]) -> None:
    """Take over the standard files, and the look of a process that was started for this job."""
    os.setsid()
    for number, file in enumerate(files):
        os.dup2(file, number)
        os.close(file)
    sys.argv = [sys.argv[0], *words[1:]]  # runpy sets the first
    # `ps` shows what is where the kernel reads a command line; the last byte says that it is one text
    fields = Path("/proc/self/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    start, end = int(fields[45]), int(fields[46])
    text = f"{sys.executable} -P -m {' '.join(words)}".encode()[: end - start - 2]
    ctypes.memmove(start, text.ljust(end - start - 1, b"\0") + b".", end - start)


if __name__ == "__main__":
    main()
