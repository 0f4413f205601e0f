"""The drivers: one process, or one process per inverter over Zenoh, and what they hand over."""
