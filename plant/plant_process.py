"""The plant as a process: its node on a Zenoh session."""

from __future__ import annotations

import gc
import logging
from collections.abc import Callable
from functools import partial
from time import monotonic

import msgspec
from msgspec.structs import replace

from gridpeers.plant.known_names import COMPILING, LISTENING, READY
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.plant.plant_interface import PlantLike
from gridpeers.plant.plant_node import PlantNode
from gridpeers.wire.driver.drive import StoppedError, drive, perform, serve
from gridpeers.wire.driver.machine import links_objection, schedule_as_batch
from gridpeers.wire.driver.process import ConfigurationError, MakeLinks, new_epoch, no_links
from gridpeers.wire.driver.session import Session
from gridpeers.wire.messages import PLANT
from gridpeers.wire.wording import not_importable


def build(config: PlantConfig) -> PlantLike:
    # numba and scipy take a second: they are imported only once the session is open
    from gridpeers.plant.build import start_plant

    return start_plant(config)


print_word = partial(print, flush=True)  # at once, for the parent process


def run_plant(
    config: PlantConfig,
    builder: Callable[[PlantConfig], PlantLike] = build,
    make_links: MakeLinks = no_links,
    on_word: Callable[[str], None] = print_word,
) -> str:
    """Run the plant until the end of the scenario; return why the run broke, empty after a good end.

    The session opens first, because it is the rendezvous: the agents find each other while the plant is built.
    `on_word` receives `LISTENING`, `COMPILING` and `READY` as the plant starts. ConfigurationError, SessionError if the
    configuration cannot work.
    """
    log = logging.getLogger("plant")
    realtime = config.clock == "realtime"
    if realtime:  # each process has an epoch of its own, which tells it from its ghost; only equality matters
        config = replace(config, epoch=new_epoch())
    else:
        schedule_as_batch()
    processes = len(config.agents) if config.agent_processes is msgspec.UNSET else config.agent_processes
    if why := links_objection(PLANT, processes + len(config.recorders)):
        raise ConfigurationError(why)
    plant: PlantLike | None = None
    listen, connect = config.listen, config.connect
    session = Session(
        "plant",
        listen=listen,
        connect=connect,
        clock=config.clock,
        rendezvous=True,
        star=config.star,
        credentials=config.credentials,
    )
    try:
        on_word(LISTENING)
        try:
            on_word(COMPILING)
            plant = builder(config)
            node = PlantNode(config, plant, make_links(PLANT, config.links))
        except ValueError as error:
            raise ConfigurationError(str(error)) from error
        except RuntimeError as error:
            return f"plant: cannot start: {error}"
        except ImportError as error:
            return f"plant: cannot start: {not_importable(error)}"
        if config.credentials is not None:
            node.post.vouches = session.vouches
        for key in node.publications:
            session.prepare(key)
        for name, agent_config in config.agent_configs.items():
            session.answer(node.keys.config(name), msgspec.json.encode(agent_config))
        if config.feeder_map:
            session.answer(node.keys.feeder_map, msgspec.json.encode(config.feeder_map))
        gc.freeze()  # the plant stays: later collections can skip it
        on_word(READY)
        try:
            drive(node, session, log)
        except (StoppedError, KeyboardInterrupt) as stop:
            node.interrupt(f"the plant was asked to leave: {stop}", 0.0)
            perform(node.take_actions(), session, log)
            raise
        except Exception as error:  # tell the agents, so that they close at once instead of seeking the plant
            node.stepper.cause = error
            node.abort(f"plant at t = {node.stepper.t:g} s: {type(error).__name__}: {error}", monotonic())
            serve(node, session, log)
    finally:
        session.close()
        if plant is not None:
            plant.close()
    if node.stepper.cause is not None:
        log.error("the plant broke", exc_info=node.stepper.cause)
    if node.rejects.counts:
        log.warning("plant: dropped messages by kind: %s", dict(node.rejects.counts))
    return node.stepper.outcome
