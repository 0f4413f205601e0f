"""Random feeders, as scripts for OpenDSS, and the inner loop's solution of them beside the engine's."""
