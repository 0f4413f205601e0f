"""The whole paper in one command: every table and figure, ours beside the paper's, and a verdict on every claim."""
