"""What travels between the processes of a run: messages, keys, codec, session set-up.

The lowest layer: it imports nothing of gridpeers. Everything but `wire.driver.session` is pure.
"""
