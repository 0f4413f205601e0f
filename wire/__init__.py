"""The communication of a run's processes: messages, keys, codec, nodes, and the driver with its Zenoh session.

This is the lowest layer: it imports nothing of gridpeers. Everything outside of `wire.driver` is pure.
"""
