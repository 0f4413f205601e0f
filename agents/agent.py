"""One agent: its knowledge, and its decision at a tick. Pure; time and messages are arguments.

An agent knows its own configuration and measurement, the nameplates it has received, and the last state of each
neighbour. SI on the wire, per unit inside: the neighbours' ratings come from their nameplates.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import inf
from types import MappingProxyType

from msgspec.structs import replace

from gridpeers.agents.agent_config import AgentConfig, nameplate_of
from gridpeers.agents.degraded_communication import IslandDetector, SaturationDetector, StalenessWeights, law_in_force
from gridpeers.agents.graphs import GraphError, in_neighbours, rule_of
from gridpeers.agents.laws.call import LawError, decide, failed_at, misnamed, objection_to, start_law
from gridpeers.agents.laws.law import NOTHING_SHARED, Law, Neighbour, Own
from gridpeers.wire.codec import RejectedMessages
from gridpeers.wire.messages import OFF, Measurement, Nameplate, State

_converted: dict[str, tuple[State, Nameplate, float, float, Neighbour]] = {}
"""The last conversion of each sender: its neighbours in one process get the same state, one after the other."""


def neighbour_of(nameplate: Nameplate, state: State, age: float, weight: float) -> Neighbour:
    """Return a neighbour as a law sees it, per unit of the neighbour's own rating."""
    name = nameplate.sender
    known = _converted.get(name)
    if known is not None and known[0] is state and known[1] is nameplate and known[2] == age and known[3] == weight:
        return known[4]
    neighbour = Neighbour(
        name,
        nameplate.kind == "GFM",
        age,
        weight,
        state.P_set / nameplate.P_rated,
        state.V_set / nameplate.V_nom,
        state.Q / nameplate.P_rated,
        nameplate.m_p,
        nameplate.m_q,
        nameplate.P_rated,
        MappingProxyType(state.shared) if state.shared else NOTHING_SHARED,  # all agents of a process see this one
    )
    _converted[name] = state, nameplate, age, weight, neighbour
    return neighbour


def neighbours_alike(nameplates: Mapping[str, Nameplate], states: Iterable[State], t: float) -> list[Neighbour]:
    """Return the senders of some states as a law sees them at the time t (s), each with the weight 1.

    Of n agents that hear each other, each needs n - 1 neighbours a tick: most are converted already.
    """
    return [
        shown[4]
        if (shown := _converted.get(state.sender)) is not None
        and shown[0] is state
        and shown[2] == t - state.t
        and shown[3] == 1.0
        and shown[1] is nameplates[state.sender]
        else neighbour_of(nameplates[state.sender], state, t - state.t, 1.0)
        for state in states
    ]


def own_of(config: AgentConfig, m: Measurement, P_set: float, V_set: float, saturated: tuple[int, int]) -> Own:
    """Return the own inverter as a law sees it, with the set-points (W, V) before its step and the saturated sides."""
    P_rated, V_nom, m_q, f_nom = config.P_rated, config.V_nom, config.m_q, config.f_nom
    return Own(
        config.name,
        config.kind == "GFM",
        m.t,
        m.P / P_rated,
        m.Q / P_rated,
        m.V / V_nom,
        (m.f - f_nom) / f_nom,
        m_q * m.Q / P_rated,  # z
        P_set / P_rated,
        V_set / V_nom,
        config.m_p,
        m_q,
        P_rated,
        V_nom,
        f_nom,
        *saturated,
    )


SIGN_OF_LIFE = 0.5
"""Longest silence of an agent whose law sends nothing, as a part of the age at which neighbours drop a state."""


class Agent:
    """State of one agent.

    By default its law is the paper's, with the configuration's gains. `board` has the last state of each agent that
    neighbours may use, where all agents of a run share it (`gridpeers.agents.agent_group`); by default the agent keeps
    those that it hears.
    """

    def __init__(self, config: AgentConfig, law: Law | None = None, board: dict[str, State] | None = None) -> None:
        self.config = config
        self.fault = ""
        """Error of the law; empty if none. After an error the agent is idle, and the inverter is on primary droop."""
        self.graph_error = ""
        """Error of the graph's rule with the present roster; empty if none. Meanwhile the agent is idle."""
        self._reported_graph_error = ""
        self._rule = rule_of(config.control)
        self._law = law_in_force(config.control) if law is None else law
        self._declared = {quantity.name: quantity for quantity in config.control.law.shared}
        self.rejects = RejectedMessages(config.name)
        """Counts the states that are dropped; those of its node, if it has one."""
        self._law_runs = False
        self._sent_at = 0.0
        self.nameplate = nameplate_of(config)
        self._known: dict[str, Nameplate] = {config.name: self.nameplate}
        self._neighbours: tuple[Iterable[str], tuple[str, ...]] = (), ()
        """The last roster, and the in-neighbours on it; forgotten when the known agents change."""
        self.heard: dict[str, State] = {} if board is None else board
        self.around: Sequence[Neighbour] = ()
        self.in_service = True
        """Whether the own inverter was on the network at the last tick; if not, the tick had no sums."""
        self.saturated = (0, 0)
        self._takes_part = config.control.acts(config.name, config.kind)
        options = config.control.degraded_communication
        self._weights = StalenessWeights(options)
        self.weighs_alike = self._weights.all_count
        self.notes_arrivals = self._weights.ages_count
        self._silent_at_most = SIGN_OF_LIFE * (
            options.max_age or (config.max_age if config.clock == "realtime" else inf)
        )
        self.watches_saturation = options.anti_windup == "conditional"
        """True if the law receives the limits at which the own inverter is saturated."""
        self._islands_from_switches = options.islands == "switches"
        self._detector = IslandDetector(config.f_nom, options.slip_max) if options.islands == "frequency" else None
        self._saturation_P, self._saturation_V = SaturationDetector(options.T_sat), SaturationDetector(options.T_sat)
        self._P_set: float | None = None
        self._V_set: float | None = None
        self._islands: tuple[str, str] = ("", "")
        self._apart: frozenset[str] = frozenset()

    def meet(self, nameplate: Nameplate) -> None:
        """Note an agent's nameplate, and forget the states of its other epochs."""
        known = self._known.get(nameplate.sender)
        if known is not None and known.epoch != nameplate.epoch:
            self._drop(nameplate.sender)
        self._known[nameplate.sender] = nameplate
        self._neighbours = (), ()

    def forget(self, name: str) -> None:
        self._known.pop(name, None)
        self._neighbours = (), ()
        self._drop(name)

    def _drop(self, name: str) -> None:
        self.heard.pop(name, None)
        self._weights.forget(name)
        if self._detector is not None:
            self._detector.forget(name)

    @property
    def set_points(self) -> tuple[float, float] | None:
        """Own set-points (W, V); None before the first tick and after a pause, when those of the measurement count."""
        return None if self._P_set is None or self._V_set is None else (self._P_set, self._V_set)

    def restart(self) -> None:
        """Let the next tick start from the set-points of its measurement, like the first one."""
        self._P_set = self._V_set = None
        self._law_runs = False
        self._islands = ("", "")

    def shares_island(self, name: str) -> bool:
        """Whether a neighbour's last state is from the own island, as far as is known (`islands`).

        A state is older than the own measurement. When all inverters change from one island to another, an agent would
        leave out all neighbours for a tick; so the previous island counts too.
        """
        state = self.heard.get(name)
        if state is not None and state.island == OFF:
            return False
        if state is None or self._detector is not None:
            return state is not None and name not in self._apart
        if not self._islands_from_switches or not state.island or not self._islands[0]:
            return True
        return state.island in self._islands

    def in_neighbours(self, roster: Iterable[str]) -> tuple[str, ...]:
        """Return the in-neighbours among the known agents of a roster by the run's rule; none if the rule fails."""
        if roster is self._neighbours[0] and not self.graph_error:
            return self._neighbours[1]
        members = {name: self._known[name] for name in roster if name in self._known}
        name = self.config.name
        if name not in members:
            return ()
        try:
            neighbours = in_neighbours(self.config.control, name, members, self._rule)
        except GraphError as error:
            self.graph_error = str(error)
            return ()
        self.graph_error = ""
        self._neighbours = roster, neighbours
        return neighbours

    def hear(self, state: State) -> bool:
        """Note the latest state of an agent with a nameplate; `gridpeers.wire.membership` has checked the sender.

        Return False if it is dropped: a value that it shares is beyond the range that the law declares.
        """
        if state.quiet:
            return True  # its law sends nothing: its last state stays valid
        if state.shared and (wrong := objection_to(state.shared, self._declared)):
            self.rejects.add("implausible", f"state/{state.sender}", f"it shares {wrong}")
            return False
        self.heard[state.sender] = state
        if self.notes_arrivals:
            self._weights.arrived(state.sender)
        return True

    def tick(
        self, measurement: Measurement, neighbours: Sequence[str] = (), ages: Mapping[str, float] | None = None
    ) -> State:
        """Decide the set-points (W, V) of this tick by the law.

        The last state of each of the `neighbours` counts with a weight (`gridpeers.agents.degraded_communication`); one
        without a state, or in another island, is left out of the sums. `ages` are those of the states (s of run time)
        by the own clock; by default the time from each state to the own measurement.
        """
        self.around, self.in_service = (), measurement.island != OFF
        if self.graph_error:
            news = self.graph_error if self.graph_error != self._reported_graph_error else ""
            self._reported_graph_error = self.graph_error
            return replace(self.idle_state(measurement), fault=news)
        if self.fault:
            return self.idle_state(measurement)
        if not self.in_service:  # nothing to control; once in service it starts from the plant's set-points
            self.restart()
            return self._state(measurement, measurement.P_set, measurement.V_set)
        config = self.config
        self._islands = (measurement.island, self._islands[0] or measurement.island)
        if self._detector is not None:
            self._apart = self._out_of_step(self._detector, measurement, neighbours)
        if not self._takes_part or measurement.grid_connected or self._P_set is None or self._V_set is None:
            # On hold the set-points follow the plant's, so that the law starts without a bump when the island forms.
            self._P_set, self._V_set = measurement.P_set, measurement.V_set
            self._saturation_P.begin()
            self._saturation_V.begin()
            self._law_runs = False
        around = self._around(measurement.t, neighbours, ages)  # on hold too, to learn the usual ages of links
        self.around = around
        shared, send = NOTHING_SHARED, True
        if self._takes_part and not measurement.grid_connected:
            self.saturated = self._saturated_sides(measurement) if self.watches_saturation else (0, 0)
            own = own_of(config, measurement, self._P_set, self._V_set, self.saturated)
            try:
                if not self._law_runs:
                    start_law(self._law, own)
                    self._law_runs = True
                P_set, V_set, shared, send, _ = decide(self._law, own, around, config.T_c)
                if shared and (wrong := misnamed(shared, self._declared) or objection_to(shared, self._declared)):
                    raise LawError(f"step at t = {own.t:.6g} s shares {wrong}")
            except LawError as error:
                law = config.control.law
                self.fault = f"law {law.name}{failed_at(self._law, error, law.folder)}: {error}"
                return replace(self.idle_state(measurement), fault=self.fault)
            self._P_set, self._V_set = P_set * config.P_rated, V_set * config.V_nom
        send = send or measurement.t - self._sent_at >= self._silent_at_most - 1e-9
        if send:
            self._sent_at = measurement.t
        state = self._state(measurement, self._P_set, self._V_set)
        return replace(state, shared=dict(shared), quiet=not send) if shared or not send else state

    def idle_state(self, measurement: Measurement) -> State:
        """Return the state of an agent that is paused, or has no measurement: it only shows that the agent is there.

        When the agent resumes, it starts from the set-points that the plant holds.
        """
        self.restart()
        return replace(self._state(measurement, measurement.P_set, measurement.V_set), Q=0.0, island="", idle=True)

    def _state(self, measurement: Measurement, P_set: float, V_set: float) -> State:
        return State(
            sender=self.config.name,
            epoch=self.config.epoch,
            seq=measurement.seq,
            t=measurement.t,
            P_set=P_set,
            V_set=V_set,
            Q=measurement.Q,
            island=measurement.island if self._islands_from_switches or measurement.island == OFF else "",
            angle=None if self._detector is None else self._detector.angle,
        )

    def _out_of_step(
        self, detector: IslandDetector, measurement: Measurement, neighbours: Sequence[str]
    ) -> frozenset[str]:
        """Return the neighbours in another island by their frequency; while grid-connected none."""
        t = measurement.t
        if measurement.grid_connected:
            detector.restart()
        detector.sensed(t, measurement.f)
        for name in neighbours:
            if name in self.heard:
                detector.heard(name, self.heard[name].t, self.heard[name].angle)
        return frozenset(name for name in neighbours if detector.apart(name, t))

    def _around(self, t: float, neighbours: Sequence[str], ages: Mapping[str, float] | None) -> list[Neighbour]:
        """Return the neighbours that count, with the age (s) and the weight of their last states."""
        heard, known, islands = self.heard, self._known, self._islands
        if self._detector is None and self._islands_from_switches and islands[0]:  # as `shares_island`, in one go
            here = [
                state
                for name in neighbours
                if (state := heard.get(name)) is not None and (state.island in islands or not state.island)
            ]
        else:
            here = [heard[name] for name in neighbours if self.shares_island(name)]
        if ages is None and self.weighs_alike:
            return neighbours_alike(known, here, t)
        aged = {state.sender: t - state.t if ages is None else ages[state.sender] for state in here}
        weights = self._weights.at_tick(aged)
        return [neighbour_of(known[name], heard[name], aged[name], weight) for name, weight in weights.items()]

    def _saturated_sides(self, measurement: Measurement) -> tuple[int, int]:
        """Return the saturated sides of P by (3), (7) and V by (4), (8), for the set-points that the plant holds."""
        config, m = self.config, measurement
        P = m.P / config.P_rated + (m.f - config.f_nom) / config.f_nom / config.m_p
        V = m.V / config.V_nom / config.m_q + m.Q / config.P_rated
        return (
            self._saturation_P.saturated_side(m.P_set / config.P_rated, P, m.t),
            self._saturation_V.saturated_side(m.V_set / config.V_nom / config.m_q, V, m.t),
        )
