"""A foreign agent: it joins a run with the packages `eclipse-zenoh` and `msgpack` alone (docs/reference/protocol.md).

Real time: `python foreign_agent.py tcp/127.0.0.1:7447 lab inv2`, with endpoint, run and inverter.
Simulated time: `python foreign_agent.py < inv2.json`, with the plant's configuration of the agent.
It runs the paper's law with default options; in simulated time it gives the bytes of an agent of gridpeers. It sends no
AgentStatus, so `gridpeers watch` shows only the plant's data.
"""

import json
import queue
import signal
import sys
import threading
import time
import zlib
from math import exp, inf, isfinite

import msgpack
import zenoh

SETTINGS = """{mode: "peer", open: {return_conditions: {connect_scouted: false, declares: false}},
  connect: {endpoints: ["%s"], timeout_ms: -1, exit_on_failure: false}, listen: {endpoints: ["tcp/127.0.0.1:0"]},
  scouting: {multicast: {enabled: false}, gossip: {autoconnect_strategy: {peer: {to_peer: "greater-zid"}}}},
  transport: {unicast: {qos: {enabled: false}}, link: {tx: {lease: %d}}}}"""


def pack(message: dict) -> bytes:
    """Return the bytes of a message: a msgpack map, then its CRC-32."""
    return (body := msgpack.packb(message)) + zlib.crc32(body).to_bytes(4, "little")


def unpack(payload: bytes) -> dict:
    """Return the message of these bytes, or raise ValueError."""
    if zlib.crc32(payload[:-4]).to_bytes(4, "little") != payload[-4:]:
        raise ValueError("wrong CRC-32")
    return dict(msgpack.unpackb(payload[:-4]))


def linked(control: dict, a: dict, b: dict) -> bool:
    """Return whether the run's rule makes two agents neighbours, by their nameplates."""
    pair, leaders = {a["sender"], b["sender"]}, a["kind"] == b["kind"] == "GFM"
    rules = {"full": True, "none": False, "GFM-only": leaders, "links": pair in map(set, control["links"])}
    rules["clustered"] = leaders or a["microgrid"] == b["microgrid"]
    return len(pair) == 2 and rules[control["graph"]] and pair not in map(set, control["without"])


def law(config: dict, P_set: float, V_set: float, m: dict, near: list) -> tuple[float, float]:
    """Return P_set (W) and V_set (V) of the next period, (12)-(15), from nameplate and state of each neighbour."""
    g, T, m_p, m_q, rated = config["control"]["gains"], config["T_c"], config["m_p"], config["m_q"], config["P_rated"]
    leader, P_set, V_set, d = config["kind"] == "GFM", P_set / rated, V_set / config["V_nom"], float(len(near))
    y_sum = z_sum = 0.0
    for plate, state in near:  # not by sum(), which rounds otherwise since Python 3.12
        y_sum += plate["m_p"] * (state["P_set"] / plate["P_rated"])
        z_sum += plate["m_q"] * (state["Q"] / plate["P_rated"])
    y_bar, z_bar = y_sum / (d or 1.0), z_sum / (d or 1.0)
    e, z, v = (m["f"] - config["f_nom"]) / config["f_nom"], m_q * m["Q"] / rated, m["V"] / config["V_nom"]
    kappa, alpha, beta = m_p / g["k_p"], g["alpha"] if leader else 0.0, g["beta_GFM" if leader else "beta_GFL"]
    alpha = max(g["alpha_min"], alpha * min(1.0, abs(v - 1.0) / g["V_full"])) if leader and g["V_full"] > 0.0 else alpha
    change = 0.5 * (1.0 - exp(-2.0 * kappa * d * T)) * (y_bar - m_p * P_set)
    change -= (1.0 - exp(-kappa * T)) * e if leader else 0.0
    a = 0.5 * (1.0 - exp(-2.0 * (beta / g["k_q"]) * d * T))
    b = a * alpha / (beta * d or 1.0)
    if alpha > 2.0 * (beta * d):
        b = 1.0 - exp(-alpha * T / g["k_q"])
        a = b * (beta * d) / alpha
    P_set = min(max(P_set + change / m_p, g["P_set_min"]), g["P_set_max"])
    V_set = min(max(V_set + (-a * (z - z_bar) - b * (v - 1.0)), g["V_set_min"]), g["V_set_max"])
    return P_set * rated, V_set * config["V_nom"]


class ForeignAgent:
    """One agent of a run; Zenoh's threads put messages and tokens into `inbox`, and `run` takes them out."""

    def __init__(self, config: dict, session: zenoh.Session) -> None:
        self.config, self.session, self.name = config, session, config["name"]
        self.realtime, self.root = config["clock"] == "realtime", f"gridpeers/{config['run']}/"
        self.head = {"sender": self.name, "epoch": time.time_ns() // 1_000_000, "seq": 0, "t": 0.0}  # noqa: TID251
        self.own = self.head | {"type": "Nameplate"}
        self.own |= {key: config[key] for key in ("kind", "microgrid", "P_rated", "V_nom", "f_nom", "m_p", "m_q")}
        self.inbox, me = queue.SimpleQueue(), f"{self.name}/{session.zid()}"
        self.alive = {tuple(me.split("/")): self.own}  # tokens that are there, (name, instance): their nameplates
        self.members: dict[str, str] = {}  # instance of each name on the last roster that was prepared
        self.states: dict[str, list] = {}  # of each neighbour the last two: its nameplate, the state, when it came
        self.neighbours: list[str] = []  # simulated time: those on the roster of the last tick
        self.prepare = self.measurement = self.set_points = None  # not answered yet; not used yet; W and V
        self.island, self.sent, self.leaving, self.status, self.due, self.ticked = "", 0, False, -1, 0.0, 0.0
        mine = (f"measurement/{self.name}", f"link_request/{self.name}", f"stop_request/{me}")
        for key in ("control", "state/*", *mine):
            session.declare_subscriber(self.root + key, self.enqueue, allowed_origin=zenoh.Locality.REMOTE)
        session.declare_queryable(key := f"{self.root}nameplate/{me}", lambda q: q.reply(key, pack(self.own)))
        session.liveliness().declare_subscriber(self.root + "alive/**", self.enqueue, history=True)
        self.token = session.liveliness().declare_token(f"{self.root}alive/agent/{me}")  # last: now all may ask

    def enqueue(self, sample: zenoh.Sample) -> None:
        """Put a message, or whether a token is there, into the inbox."""
        key, there = str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT
        self.inbox.put((key, there if key.startswith(self.root + "alive/") else sample.payload.to_bytes()))

    def publish(self, key: str, kind: str, seq: int, t: float, **fields: object) -> None:
        """Publish a message; in real time Zenoh drops a state rather than wait."""
        control = zenoh.CongestionControl.DROP if self.realtime and key == "state" else zenoh.CongestionControl.BLOCK
        message = {**self.head, "type": kind, "seq": seq, "t": t, **fields}
        self.session.put(f"{self.root}{key}/{self.name}", pack(message), congestion_control=control)

    def run(self) -> int:
        """Take part until the run ends; return the exit status."""
        while self.status < 0 and not (self.leaving and time.monotonic() >= self.due):
            key = "a tick"
            try:
                self.tick()
                key, item = self.inbox.get(timeout=max(0.0, self.due - time.monotonic()) if self.due else None)
                self.take(key.removeprefix(self.root).split("/"), item)
            except queue.Empty:
                pass
            except (ArithmeticError, LookupError, TypeError, ValueError) as error:  # reject that message alone
                print(f"{self.name}: dropped {key}: {error!r}", file=sys.stderr)
        return max(0, self.status)

    def take(self, key: list[str], item: bytes | bool | None) -> None:
        """Take a message, or a token: whether it is there."""
        message = unpack(item) if isinstance(item, bytes) else {"type": "Stop"}
        needed = {"State": "P_set V_set Q t seq", "Measurement": "P_set V_set Q V f t seq"}.get(message["type"], "")
        if not all(isfinite(message[name]) for name in needed.split()):
            raise ValueError("not finite")
        who, speaker = tuple(key[-2:]), self.plate(key[-1] if message["type"] == "State" else "plant")
        if (key[0] == "alive" and item) or (key[0] == "asked" and who in self.alive):
            self.alive.setdefault(who, {"sender": "plant", "epoch": int(who[1])} if who[0] == "plant" else None)
            if key[1] == "agent" and not self.alive[who]:  # ask who it is; we have subscribed before
                again = threading.Timer(0.1, self.inbox.put, [(f"{self.root}asked/{who[0]}/{who[1]}", None)]).start
                answer = zenoh.handlers.Callback(lambda r: r.ok and self.enqueue(r.ok), again)  # again: once it is over
                self.session.get(f"{self.root}nameplate/{who[0]}/{who[1]}", answer, timeout=1.0)
        elif key[0] in ("alive", "asked"):
            self.alive.pop(who, None)
            if who[0] == "plant":
                self.measurement, self.due, self.status = None, 0.0, -1 if self.realtime else 3
        elif key[0] == "nameplate" and who in self.alive:
            self.alive[who] = message
        elif key != ["leave"] and any(message[same] != (speaker or {}).get(same) for same in ("sender", "epoch")):
            raise ValueError("not of the process that holds this name")
        elif message["type"] == "State" and linked(self.config["control"], self.own, speaker):
            old = [heard for heard in self.states.get(key[1], []) if heard[0] == speaker][-1:]
            last = old[0][1] if old else message | {"island": "off"}  # an idle or quiet neighbour
            value = last if message.get("idle") or message.get("quiet") else message  # its own values are not valid
            self.states[key[1]] = [*old, (speaker, {**value, "seq": message["seq"]}, time.monotonic())]
        elif message["type"] == "Prepare":
            self.members, self.prepare = dict(zip(message["roster"], message["instances"], strict=True)), message
        elif message["type"] == "Measurement":
            self.measurement = message
            if self.realtime and not self.leaving:  # decide in the middle of the period
                self.due = self.due or time.monotonic() + 0.5 * self.config["T_c"] / self.config["speed"]
        elif message["type"] == "Stop" and self.realtime and not (self.leaving or message.get("refused")):
            self.publish("leave", "Leave", self.sent, 0.0)  # the plant answers with another Stop
            self.leaving, self.due = True, time.monotonic() + 1.0
        elif message["type"] == "Stop":
            self.status = (2 if self.realtime else 3) if message.get("refused") else 0
        elif message["type"] == "LinkRequest":
            answer = {"ok": False, "text": "no emulated links", "reply_to": message["reply_to"], "data": b""}
            self.publish("link_acknowledgement", "LinkAcknowledgement", message["seq"], message["t"], **answer)
        if self.prepare and all(self.alive.get(member) for member in self.members.items()):
            self.publish("ready", "Ready", self.prepare["seq"], self.prepare["t"])
            self.prepare = None

    def plate(self, name: str) -> dict | None:
        """Return the nameplate of the process that holds a name: the instance on the roster, or else the first."""
        instances = [i for other, i in self.alive if other == name and i == self.members.get(name, i)]
        return self.alive[name, instances[0]] if instances else None

    def tick(self) -> None:
        """Decide and send: in real time when it is due, in simulated time once all neighbours' states are here."""
        m, c, now, near = self.measurement, self.config, time.monotonic(), []
        if m is None or self.leaving or now < self.due:
            return
        k, speed, limit = (self.sent, c["speed"], c["max_age"]) if self.realtime else (m["seq"], 1.0, inf)
        for name in list(self.states) if self.realtime else [n for n in self.neighbours if n in self.members]:
            heard = [one for one in self.states.get(name, []) if self.realtime or one[1]["seq"] < k][-1:]
            late = not heard or heard[0][1]["seq"] < k - 1
            if late and not self.realtime and (name, self.members[name]) in self.alive:
                return
            for plate, state, came in heard:
                here = state.get("island", "") in ("", m["island"], self.island or m["island"])
                near += [(plate, state)] if here and max((now - came) * speed, m["t"] - state["t"]) <= limit else []
        secondary, off = c["control"]["secondary"], m["island"] == "off"
        acts = self.name in secondary if isinstance(secondary, list) else secondary in ("all", self.own["kind"])
        free = acts and not m["grid_connected"] and not off
        if not free or self.set_points is None or (now - self.ticked) * speed > limit:
            self.set_points = m["P_set"], m["V_set"]
        self.measurement, self.due, self.ticked, self.sent = None, 0.0, now, self.sent + 1
        P_set, V_set = law(c, *self.set_points, m, near) if free else self.set_points
        self.publish("state", "State", k, m["t"], P_set=P_set, V_set=V_set, Q=m["Q"], island=m["island"])
        self.set_points, self.island = (None, "") if off else ((P_set, V_set), m["island"])
        self.neighbours = [n for n in self.members if (p := self.plate(n)) and linked(c["control"], self.own, p)]


if __name__ == "__main__":
    config = json.load(sys.stdin) if len(sys.argv) == 1 else None
    lease = 2_000 if config is None or config["clock"] == "realtime" else 86_400_000
    endpoint = config["connect"][0] if config else sys.argv[1]
    with zenoh.open(zenoh.Config.from_json5(SETTINGS % (endpoint, lease))) as session:
        while config is None:
            for reply in session.get("gridpeers/{}/config/{}".format(*sys.argv[2:]), timeout=1.0):
                config = json.loads(reply.ok.payload.to_string()) if reply.ok else None
        agent = ForeignAgent(config, session)
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, lambda *_: agent.inbox.put(("leave", None)))
        sys.exit(agent.run())
