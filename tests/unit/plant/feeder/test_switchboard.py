import pytest
from msgspec.structs import replace

from gridpeers.plant.equipment.imported_equipment import bus_behind
from gridpeers.plant.feeder.switchboard import Switchboard
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import SwitchEvent

H = 0.002


def event(t: float, switch: str, action: str) -> SwitchEvent:
    """An operation on schedule."""
    return SwitchEvent(t=t, switch=switch, action="open" if action == "open" else "close")


def test_a_step_operates_its_switches_together(network: Network) -> None:
    """All switches of one step are operated at once, by whatever name, and each is told with its alias."""
    board = Switchboard(network, (event(0.5, "sw1_2", "open"), event(0.5, "152-13", "open")), H)

    told = board.operate(250)

    assert not board.steps
    assert board.closed == network.closed0 - {"67s-67", "13-152"}
    assert [(note.t, note.kind, note.subject, note.text) for note in told] == [
        (0.5, "switch", "67s-67", "switch sw1_2 (67s-67) opened"),
        (0.5, "switch", "13-152", "switch 13-152 opened"),
    ]


def test_a_switch_of_an_imported_line_is_named_after_the_line(network: Network) -> None:
    """The bus that an import puts behind a switch is in no drawing of the user's, so events do not name it."""
    (first, *others) = network.feeder.switches
    behind = bus_behind(first.from_bus, "head")
    imported = replace(first, name=f"{first.from_bus}-{behind}", alias="head", to_bus=behind)
    bus = next(bus for bus in network.feeder.buses if bus.name == first.from_bus)
    buses = (*network.feeder.buses, replace(bus, name=behind))
    board = Switchboard(Network(replace(network.feeder, buses=buses, switches=(imported, *others))), (), H)

    board.put(0, "head", "open")
    (told,) = board.operate(0)

    assert (told.subject, told.text) == ("head", "switch head opened")
    assert imported.name not in board.closed


def test_an_idle_operation_says_so(network: Network) -> None:
    """Closing a closed switch, or opening an open one, changes nothing and is told as such."""
    board = Switchboard(network, (event(0.0, "13-152", "close"),), H)
    board.put(1, "13-152", "open")
    board.put(1, "13-152", "open")

    texts = [note.text for step in (0, 1) for note in board.operate(step)]

    assert texts == [
        "switch 13-152 was closed already",
        "switch 13-152 opened",
        "switch 13-152 was open already",
    ]


def test_switch_states_are_foreseen_in_order_of_time(network: Network) -> None:
    """The states of a schedule are known before any of it has come, however it is written down."""
    board = Switchboard(network, (event(2.0, "13-152", "close"), event(1.0, "13-152", "open")), H)

    assert list(board.foreseen()) == [network.closed0 - {"13-152"}, network.closed0]
    assert board.closed == network.closed0


def test_an_unknown_switch_is_refused_when_it_is_put_down(network: Network) -> None:
    """A misspelled switch is an error at the start of a run, not at its time."""
    with pytest.raises(ValueError, match=r'switch "13-125": no such switch'):
        Switchboard(network, (event(1.0, "13-125", "open"),), H)


def test_a_switch_that_was_refused_leaves_nothing_to_be_done(network: Network) -> None:
    """Nothing happens at that step, so nothing is told of it."""
    board = Switchboard(network, (), H)
    with pytest.raises(ValueError, match="no such switch"):
        board.put(5, "sw9", "open")

    assert not board.steps


def test_what_was_operated_is_forgotten(network: Network) -> None:
    """A run in which people switch for hours does not get slower, and what comes is foreseen from what is."""
    board = Switchboard(network, (event(1.0, "60-160", "open"),), H)
    for step in range(100):
        board.put(step, "13-152", "open" if step % 2 else "close")
        board.operate(step)
    board.put(100, "13-152", "close")
    board.drop(100, board.due(100)[0])

    assert list(board.steps) == [500]
    assert list(board.foreseen()) == [network.closed0 - {"13-152", "60-160"}]
