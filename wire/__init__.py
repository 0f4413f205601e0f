"""The communication of a run's processes: messages, keys, codec, nodes, and the driver with its Zenoh session.

This is the lowest layer: it imports nothing of gridpeers. Everything outside of `gridpeers.wire.driver` is pure.
"""

if not __name__.startswith("gridpeers."):
    raise ImportError(f"import gridpeers.{__name__}: this folder is linked there, and no module is loaded twice")
