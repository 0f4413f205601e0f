"""The drivers of a run: in one process, or with one process per inverter over Zenoh."""
