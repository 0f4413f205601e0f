"""A run: all processes of one way, and the time until their sessions hear each other."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from pathlib import Path
from time import monotonic, sleep
from typing import Any

from bench.discovery.ways_to_meet import HUB, Places, Way


class Run:
    """All processes of one way."""

    def __init__(self, way: Way, places: Places) -> None:
        self._way, self._places = way, places
        command = [sys.executable, "-m", "bench.discovery", "worker"]
        self._hosts = [
            subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
            for _ in range(places.processes + 1)
        ]
        self.lives = dict.fromkeys(range(places.count), 1)
        for k in range(len(self._hosts)):
            self._ask(k, [["state"]])

    def _ask(self, k: int, questions: list[list[Any]]) -> list[Any]:
        host = self._hosts[k]
        assert host.stdin is not None
        assert host.stdout is not None
        answers = []
        for question in questions:
            host.stdin.write(json.dumps(question) + "\n")
            host.stdin.flush()
            line = host.stdout.readline()
            if not line:  # it was ended, as it did not answer in time
                raise SystemExit
            answers.append(json.loads(line))
        return answers

    def _ask_all(self, questions: dict[int, list[list[Any]]], deadline: float) -> dict[int, list[Any]]:
        """Ask processes at once; those that do not answer in time are left out."""
        answers: dict[int, list[Any]] = {}
        threads = [
            threading.Thread(target=lambda k=k: answers.update({k: self._ask(k, questions[k])}), daemon=True)
            for k in questions
        ]
        until = monotonic() + deadline
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(max(0.0, until - monotonic()))
        return dict(answers)

    def change(self, what: str, numbers: list[int], deadline: float) -> bool:
        """Open or close sessions; return whether that was done in time."""
        questions: dict[int, list[list[Any]]] = {}
        for i in numbers:
            k = self._places.processes if i == HUB else self._places.process(i)
            near = [] if i == HUB else self._places.near[i]
            more = [self.lives.get(i, 1), self._way(self._places, i), near] if what == "open" else []
            questions.setdefault(k, []).append([what, str(i), *more])
        answers = self._ask_all(questions, deadline)
        return len(answers) == len(questions) and all(all(done) for done in answers.values())

    def until_all_hear(self, since: float, deadline: float) -> tuple[float | None, list[int], int]:
        """Return the time (s) until all heard their neighbours, the links of each, and how many are still deaf."""
        until = monotonic() + deadline
        links: list[int] = []
        deaf = self._places.count
        while monotonic() < until:
            states = self._ask_all({k: [["state"]] for k in range(self._places.processes)}, until - monotonic())
            if len(states) < self._places.processes:
                break
            deaf, links = 0, []
            for (state,) in states.values():
                links += state["links"].values()
                for i, seen in state["seen"].items():
                    known = {(kind, j): life for kind, j, life in seen}
                    near = self._places.near[int(i)]
                    wanted = [(kind, j) for j in near for kind in ("alive", "state")]
                    deaf += any(known.get(one, 0) < self.lives[one[1]] for one in wanted)
            if not deaf and sum(len(state["seen"]) for (state,) in states.values()) == self._places.count:
                return max(state["last"] for (state,) in states.values()) - since, links, 0
            sleep(0.05)
        return None, links, deaf

    def end(self) -> float:
        """End all processes; return their CPU time (s)."""
        spent = 0.0
        for host in self._hosts:
            fields = Path(f"/proc/{host.pid}/stat").read_text().rpartition(")")[2].split()
            spent += (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
            host.kill()
            host.wait()
        return spent
