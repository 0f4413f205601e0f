"""Our plant against GridLAB-D; see `bench.gridlabd.compare_gridlabd`."""
