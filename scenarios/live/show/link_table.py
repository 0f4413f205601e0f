"""The impaired links of a run, as text for `gridpeers link show`."""

from __future__ import annotations

from collections.abc import Mapping

from gridpeers.scenarios.emulation.link_reports import LinkStatus
from gridpeers.scenarios.short_names import in_order
from gridpeers.wire.messages import PLANT

_HEAD = ("link", "sent", "delivered", "dropped", "now")


def links_text(run: str, t: float, stands: Mapping[tuple[str, str], LinkStatus]) -> str:
    """One line for each link that is impaired now, one for all that once were.

    Parameters
    ----------
    run : str
        Name of the run.
    t : float
        Run time (s).
    stands : Mapping
        How links stand, by sender and receiver.

    Examples
    --------
    >>> print(links_text("lab", 2.0, {("inv1", "inv4"): LinkStatus(holds=("loss 0.2",))}), end="")
    run lab   t = 2.00 s   1 link impaired
    link          sent  delivered  dropped  now
    inv1 -> inv4     0          0        0  loss 0.2
    """
    names = in_order({name for link in stands for name in link} - {PLANT})
    order = {name: i for i, name in enumerate([*names, PLANT])}
    now = {link: stands[link] for link in sorted(stands, key=lambda ends: (order[ends[0]], order[ends[1]]))}
    now = {link: stand for link, stand in now.items() if stand.holds}
    before = [stand for link, stand in stands.items() if link not in now]
    count = "no link is impaired" if not now else f"{len(now)} link{'s' if len(now) > 1 else ''} impaired"
    text = [f"run {run}   t = {t:.2f} s   {count}"]
    rows = [_HEAD, *((f"{src} -> {dst}", *_counts(stand), ", ".join(stand.holds)) for (src, dst), stand in now.items())]
    widths = [max(len(row[i]) for row in rows) for i in range(len(_HEAD))]
    for row in rows if now else []:
        cells = [
            cell.rjust(width) if 0 < i < 4 else cell.ljust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        text.append("  ".join(cells).rstrip())
    if before:
        books = [stand.counts for stand in before if stand.counts is not None]
        sent, dropped = sum(book.sent for book in books), sum(sum(book.dropped.values()) for book in books)
        text.append(f"impaired before: {len(before)} links; sent over them {sent}, dropped {dropped}")
    return "\n".join(text) + "\n"


def _counts(stand: LinkStatus) -> tuple[str, str, str]:
    book = stand.counts
    if book is None:
        return "0", "0", "0"
    reasons = ", ".join(f"{reason} {count}" for reason, count in sorted(book.dropped.items()))
    return str(book.sent), str(book.delivered), f"{sum(book.dropped.values())}" + (f" ({reasons})" if reasons else "")
