"""One agent: what it knows, and what it decides at a tick. Pure; time and messages are arguments.

An agent knows its own configuration and measurement, the nameplates it was shown, and the last state it heard of each
neighbour. SI on the wire, per unit inside: the neighbours' ratings come from their nameplates.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import inf

from msgspec.structs import replace

from agents.agent_config import AgentConfig
from agents.degraded_communication import SaturationDetector, StalenessWeights
from agents.graphs import GraphError
from agents.island_detector import IslandDetector
from agents.laws.call import LawError, begun, decided
from agents.laws.in_force import law_in_force
from agents.laws.law import NOTHING, Law, Neighbour, Own
from agents.own_nameplate import nameplate_of
from agents.topology import in_neighbours, rule_of
from wire.messages import OFF, Measurement, Nameplate, State

SPEAKS = 0.5
"""Part of the age at which neighbours drop a state, after which they are told at the latest, whatever the law says."""


def neighbour_of(plate: Nameplate, state: State, age: float, weight: float) -> Neighbour:
    """Return what a law is told of a neighbour, per unit of the neighbour's own rating."""
    return Neighbour(
        name=plate.sender,
        leader=plate.kind == "GFM",
        age=age,
        weight=weight,
        P_set=state.P_set / plate.P_rated,
        V_set=state.V_set / plate.V_nom,
        Q=state.Q / plate.P_rated,
        m_p=plate.m_p,
        m_q=plate.m_q,
        P_rated=plate.P_rated,
        shared=state.shared,
    )


class Agent:
    """State of one agent.

    Parameters
    ----------
    config : AgentConfig
        Who it is and the run's rule.
    law : Law, optional
        What decides its set-points; the paper's, with the configuration's gains, if left out.

    Examples
    --------
    Where secondary control is not for this inverter, it keeps what the plant holds:

    >>> from agents.agent_config import Control
    >>> agent = Agent(AgentConfig(run="demo", name="inv1", kind="GFM", microgrid="mg1", P_rated=6e5, V_nom=277.0,
    ...     f_nom=60.0, m_p=0.01, m_q=0.05, T_c=0.02, control=Control(secondary="none", graph="none"), deadline=10.0,
    ...     connect=()))
    >>> agent.tick(Measurement(sender="plant", epoch=1, seq=0, t=0.0, to="inv1", P=3e5, Q=0.0, V=277.0, f=59.9,
    ...     P_set=3e5, V_set=277.0, grid_connected=False, island="inv1", roster=("inv1",))).P_set
    300000.0
    """

    def __init__(self, config: AgentConfig, law: Law | None = None) -> None:
        self.config = config
        self.fault = ""
        """Error of the law; empty if none. After one the agent stands still, and the inverter is on primary droop."""
        self._no_graph = self._no_graph_told = ""
        """Error of the graph's rule with the present roster, and the last that was reported. Meanwhile the agent stands
        still."""
        self._rule = rule_of(config.control)
        self._law = law_in_force(config.control) if law is None else law
        self._law_runs = False
        """Whether the law has decided since it was last on hold."""
        self._sent_at = 0.0
        """When neighbours were told last (s of run time)."""
        self.nameplate = nameplate_of(config)
        self._known: dict[str, Nameplate] = {config.name: self.nameplate}
        self._heard: dict[str, State] = {}
        self._leader = config.kind == "GFM"
        self._takes_part = config.control.acts(config.name, config.kind)
        handling = config.control.handling
        self._weights = StalenessWeights(handling)
        self._silent_at_most = SPEAKS * (handling.max_age or (config.max_age if config.clock == "wall" else inf))
        self._stops = handling.anti_windup == "conditional"
        self._is_told_islands = handling.islands == "switches"
        self._detector = IslandDetector(config.f_nom, handling.slip_max) if handling.islands == "frequency" else None
        self._saturation_P, self._saturation_V = SaturationDetector(handling.T_sat), SaturationDetector(handling.T_sat)
        self._P_set: float | None = None
        self._V_set: float | None = None
        self._islands: tuple[str, str] = ("", "")
        """Own island at the last two measurements, the latest first."""
        self._apart: frozenset[str] = frozenset()
        """Neighbours that are out of step."""

    def knows(self, name: str) -> bool:
        """Whether the nameplate of an agent has been seen."""
        return name in self._known

    def meet(self, nameplate: Nameplate) -> None:
        """Note who somebody is; what was heard of another life of it is forgotten."""
        known = self._known.get(nameplate.sender)
        if known is not None and known.epoch != nameplate.epoch:
            self._drop(nameplate.sender)
        self._known[nameplate.sender] = nameplate

    def forget(self, name: str) -> None:
        """Forget who somebody is and what it said, as its process is gone."""
        self._known.pop(name, None)
        self._drop(name)

    def _drop(self, name: str) -> None:
        self._heard.pop(name, None)
        self._weights.forget(name)
        if self._detector is not None:
            self._detector.forget(name)

    def restart(self) -> None:
        """Have the next tick start from the set-points that its measurement shows, as the first one does."""
        self._P_set = self._V_set = None
        self._law_runs = False
        self._islands = ("", "")

    def shares_island(self, name: str) -> bool:
        """Whether the last state heard of a neighbour is from the own island, as far as is known (`Handling.islands`).

        A state is older than the own measurement. So that nobody leaves out everybody at the tick at which all go from
        one island to another, the island before counts too.
        """
        state = self._heard.get(name)
        if state is not None and state.island == OFF:
            return False
        if state is None or self._detector is not None:
            return state is not None and name not in self._apart
        return not self._is_told_islands or not state.island or not self._islands[0] or state.island in self._islands

    def in_neighbours(self, roster: Iterable[str]) -> tuple[str, ...]:
        """Whom this agent listens to among the known agents of a roster, by the run's rule; nobody if that fails."""
        members = {name: self._known[name] for name in roster if name in self._known}
        name = self.config.name
        if name not in members:
            return ()
        try:
            found = in_neighbours(self.config.control, name, members, self._rule)
        except GraphError as error:
            self._no_graph = str(error)
            return ()
        self._no_graph = ""
        return found

    def hear(self, state: State) -> None:
        """Note the latest state of somebody whose nameplate is known. Who may speak, `wire.admission` has checked."""
        if state.quiet:
            return  # its law does not tell: what it told last stands
        self._heard[state.sender] = state
        self._weights.arrived(state.sender)

    def tick(
        self, measurement: Measurement, neighbours: Sequence[str] = (), ages: Mapping[str, float] | None = None
    ) -> State:
        """Decide the set-points of this tick, as the law has it.

        Parameters
        ----------
        measurement : Measurement
            What the own sensors read now; the own values are always fresh.
        neighbours : Sequence[str], optional
            Whom to listen to. Of each the last state heard counts, for what `agents.degraded_communication` says it is
            worth; one that was never heard, or stands in another island, is left out of the sums.
        ages : Mapping[str, float], optional
            Age of these states (s of run time), where the own clock knows more than the times written in them. Without
            it, from there to the own measurement.

        Returns
        -------
        State
            The set-points (W, V) and the own var (var).
        """
        if self._no_graph:
            news = self._no_graph if self._no_graph != self._no_graph_told else ""
            self._no_graph_told = self._no_graph
            return replace(self.stand_still(measurement), fault=news)
        if self.fault:
            return self.stand_still(measurement)
        if measurement.island == OFF:  # nothing to control; back in service it begins from what the plant holds
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
        counted = self._counted(measurement.t, neighbours, ages)  # on hold too: what is usual of a link is learnt there
        shared, send = NOTHING, True
        if self._takes_part and not measurement.grid_connected:
            own = self._own(measurement)
            around = [neighbour_of(self._known[name], self._heard[name], *of) for name, of in counted.items()]
            try:
                if not self._law_runs:
                    begun(self._law, own)
                    self._law_runs = True
                P_set, V_set, shared, send = decided(self._law, own, around, config.T_c)
            except LawError as error:
                self.fault = f"law {config.control.law.name}: {error}"
                return replace(self.stand_still(measurement), fault=self.fault)
            self._P_set, self._V_set = P_set * config.P_rated, V_set * config.V_nom
        send = send or measurement.t - self._sent_at >= self._silent_at_most - 1e-9
        if send:
            self._sent_at = measurement.t
        state = self._state(measurement, self._P_set, self._V_set)
        return replace(state, shared=dict(shared), quiet=not send) if shared or not send else state

    def stand_still(self, measurement: Measurement) -> State:
        """Return the state of an agent that is paused, or has no measurement: it only shows that the agent is there.

        When the agent goes on, it begins from the set-points that the plant holds.
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
            island=measurement.island if self._is_told_islands or measurement.island == OFF else "",
            angle=None if self._detector is None else self._detector.angle,
        )

    def _out_of_step(
        self, detector: IslandDetector, measurement: Measurement, neighbours: Sequence[str]
    ) -> frozenset[str]:
        """Neighbours that the frequency tells to stand in another island; on the grid nobody does."""
        t = measurement.t
        if measurement.grid_connected:
            detector.restart()
        detector.sensed(t, measurement.f)
        for name in neighbours:
            if name in self._heard:
                detector.heard(name, self._heard[name].t, self._heard[name].angle)
        return frozenset(name for name in neighbours if detector.apart(name, t))

    def _own(self, m: Measurement) -> Own:
        """Return the own inverter as the law sees it."""
        config, e = self.config, (m.f - self.config.f_nom) / self.config.f_nom
        assert self._P_set is not None
        assert self._V_set is not None
        P_saturated, V_saturated = self._saturated_sides(m, e) if self._stops else (0, 0)
        return Own(
            name=config.name,
            leader=self._leader,
            t=m.t,
            P=m.P / config.P_rated,
            Q=m.Q / config.P_rated,
            V=m.V / config.V_nom,
            e=e,
            z=config.m_q * m.Q / config.P_rated,
            P_set=self._P_set / config.P_rated,
            V_set=self._V_set / config.V_nom,
            m_p=config.m_p,
            m_q=config.m_q,
            P_rated=config.P_rated,
            V_nom=config.V_nom,
            f_nom=config.f_nom,
            P_saturated=P_saturated,
            V_saturated=V_saturated,
        )

    def _counted(
        self, t: float, neighbours: Sequence[str], ages: Mapping[str, float] | None
    ) -> dict[str, tuple[float, float]]:
        """Return age (s) and weight of the last state of each neighbour that counts."""
        heard = {name: self._heard[name] for name in neighbours if self.shares_island(name)}
        aged = {name: t - state.t if ages is None else ages[name] for name, state in heard.items()}
        return {name: (aged[name], weight) for name, weight in self._weights.at_tick(aged).items()}

    def _saturated_sides(self, measurement: Measurement, e: float) -> tuple[int, int]:
        """Sides on which P and V have long been off (3), (7) and (4), (8) with the set-points that the plant holds."""
        config, m = self.config, measurement
        P = m.P / config.P_rated + e / config.m_p
        V = m.V / config.V_nom / config.m_q + m.Q / config.P_rated
        return (
            self._saturation_P.saturated_side(m.P_set / config.P_rated, P, m.t),
            self._saturation_V.saturated_side(m.V_set / config.V_nom / config.m_q, V, m.t),
        )
