"""The faults, one a file: frozen structs with units in their keys, and what each does to a message, pure.

A model says what may be written (`problems`), its law, and how it is drawn (`sampler`, from a `Stream`). What a random
model draws is a function of the message's number alone; see `netem.draws`.
"""
