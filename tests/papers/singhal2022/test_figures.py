"""Figures of the paper that are of no single run."""

from gridpeers.papers.singhal2022.figures import topologies

from .test_claims import graph_run


def test_unconnected_graphs_have_their_own_mark() -> None:
    """Also those with enough links for a tree: they are in the legend, and not in the median."""
    runs = [graph_run(8, 1.0, connected=True), graph_run(9, 0.8, connected=True), graph_run(9, None, connected=False)]
    page = topologies(runs)
    left, right = page.axes

    marks = {line.get_marker(): list(line.get_xdata()) for line in right.get_lines() if line.get_marker() in "ox"}
    assert marks == {"o": [8, 9], "x": [9]}
    median = next(line for line in left.get_lines() if line.get_linewidth() == 2.0)
    assert list(median.get_ydata()) == [1.0, 0.8]
    assert "a graph in parts" in [text.get_text() for text in page.legends[0].get_texts()]
    assert "never" in [text.get_text() for text in left.texts]
