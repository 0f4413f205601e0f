"""Runs in wall-clock time by hand: a plant here, agents there, and commands that look at them and change them."""
