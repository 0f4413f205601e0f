"""Our plant against GridLAB-D; see `bench.gridlabd.__main__`."""
