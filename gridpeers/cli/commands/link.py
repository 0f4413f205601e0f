"""Commands that give links faults and heal them during a run."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from gridpeers.cli.commands.options import LiveRun, of_live_run
from gridpeers.cli.usage import BROKEN, Commands, argument, fail, flag, option
from gridpeers.scenarios.live.run_address import UsageError

link = typer.Typer(
    cls=Commands,
    no_args_is_help=True,
    help="Impair and heal links of a live run.\n\n"
    "A link goes from an agent to an agent, or between the plant and an agent. "
    'Name it by sender and receiver: "inv1 -> inv4", or inv1 inv4. "inv4 <-> inv7" means both directions; '
    '"MG1 -> MG2" and "* -> inv2" mean several links; "plant" is a name too.\n\n'
    'Example:  gridpeers link set "inv1 -> inv4" --delay 0.1 --jitter 0.02 --loss 0.2',
)

_Ends = Annotated[list[str], argument("LINKS", 'A pattern such as "inv1 -> inv4", or two names: sender and receiver.')]
_For = Annotated[float | None, option("SECONDS", "Duration of the fault (s of run time); no end if left out.", "--for")]


@link.command("set")
@of_live_run
def set_(
    links: _Ends,
    live: LiveRun,
    delay: Annotated[float | None, option("SECONDS", "Delay of every message.")] = None,
    jitter: Annotated[float | None, option("SECONDS", "Uniform delays: --delay plus or minus this time.")] = None,
    loss: Annotated[float | None, option("P", "Probability that a message is lost, 0 to 1.")] = None,
    duplicate: Annotated[float | None, option("P", "Probability of a second copy, 0 to 1.")] = None,
    corrupt: Annotated[float | None, option("P", "Probability of a flipped bit, 0 to 1.")] = None,
    rate: Annotated[float | None, option("BYTES", "Rate of the link, in bytes per second.")] = None,
    profile: Annotated[str, option("NAME", "A named link, e.g. lte; see docs/reference/link-faults.md.")] = "",
    duration: _For = None,
) -> None:
    """Set faults of links. A fault replaces the link's fault of the same kind.

    Example:  gridpeers link set inv1 inv4 --delay 0.1 --loss 0.2 --for 10
    """
    given = {"loss": loss, "duplicate": duplicate, "corrupt": corrupt, "rate": rate}
    fault = {key: value for key, value in given.items() if value is not None} | _delay(delay, jitter)
    if not fault and not profile:
        options = "--delay, --jitter (with --delay), --loss, --duplicate, --corrupt, --rate, --profile"
        raise UsageError(f"nothing to set; give one of {options}")
    _give(links, "->", fault | {"profile": profile}, duration, live)


@link.command()
@of_live_run
def cut(
    links: _Ends,
    live: LiveRun,
    one_way: Annotated[bool, flag("With two names: cut only from the first to the second.", "--one-way")] = False,
    hold: Annotated[bool, flag("Keep the messages, and deliver them when the link is healed.", "--hold")] = False,
    duration: _For = None,
) -> None:
    """Cut links; two names mean both directions.

    Example:  gridpeers link cut inv4 inv7 --for 5
    """
    from gridpeers.netem.models.medium import Cut

    _give(links, "->" if one_way else "<->", {"cut": Cut(hold=hold)}, duration, live)


@link.command()
@of_live_run
def heal(
    live: LiveRun,
    links: Annotated[
        list[str] | None, argument("[LINKS]", "A pattern, or two names (both directions); all links if left out.")
    ] = None,
) -> None:
    """End the present faults of links. Later faults of the scenario still begin.

    Example:  gridpeers link heal inv4 inv7
    """
    _give(links or [], "<->", None, None, live)


def _delay(delay: float | None, jitter: float | None) -> dict[str, Any]:
    from gridpeers.netem.models.delay import DELAY, Uniform

    if jitter is None:
        return {} if delay is None else {"delay": delay}
    if delay is None:
        raise UsageError("--jitter: needs --delay; delays are --delay plus or minus --jitter")
    if wrong := DELAY.objection(delay, "s"):
        raise UsageError(f"--delay: {wrong}")
    if not 0.0 < jitter <= delay:
        raise UsageError(f"--jitter: must be above 0 s, and at most the delay of {delay:g} s, got {jitter:g} s")
    return {"delay": Uniform(low_s=round(delay - jitter, 9), high_s=round(delay + jitter, 9))}


def _pattern(links: list[str], arrow: str) -> str:
    if "-" in links:
        raise UsageError('LINKS: the shell took the arrow for a redirection; put the pattern in quotes: "inv1 -> inv4"')
    if len(links) == 2 and not any("->" in word for word in links):
        return f"{links[0]} {arrow} {links[1]}"
    if len(links) == 1:
        return links[0]
    raise UsageError(
        f'LINKS: "{" ".join(links)}" is neither two names nor one pattern; write inv1 inv4, or "inv1 -> inv4" in quotes'
    )


def _give(links: list[str], arrow: str, fault: dict[str, Any] | None, duration: float | None, live: LiveRun) -> None:
    """Check a link command, give it, and print the receivers' answers; without a fault it heals."""
    from gridpeers.netem.fault_schedule import Heal
    from gridpeers.netem.schema.fault import Fault
    from gridpeers.netem.schema.pattern import objections
    from gridpeers.scenarios.emulation.link_data import EVERYTHING, LinkCommand
    from gridpeers.scenarios.live.run_requests import check_link_command, command_links, links_of_run

    on = _pattern(links, arrow) if links else EVERYTHING
    if wrong := objections(on, None, {}):
        raise UsageError(f"LINKS: {wrong[0]}")
    heal = Heal(on=on, from_s=0.0) if fault is None else None
    command = LinkCommand(fault=None if fault is None else Fault(on=on, **fault), heal=heal, for_s=duration)
    check_link_command(command, None)
    with live.client(acts=True) as client:
        setup = links_of_run(client)
        check_link_command(command, setup)
        result = command_links(client, command)
    typer.echo(result.text)
    if result.acknowledged:
        typer.echo(f"acknowledged: {', '.join(result.acknowledged)}")
    if result.absent:
        typer.echo(f"no agent yet, will be told when it joins: {', '.join(result.absent)}")
    if result.failures:
        fail(*result.failures, code=BROKEN)
