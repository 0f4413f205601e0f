"""What a link does to a message: delay, loss, duplicate, corrupt, rate, slots, cuts; and real sockets beside it.

The pure core imports no clock, no socket and no file, and neither numpy nor scipy: agents' processes start fast.
docs/netem.md has every model with its formula, keys and units.
"""
