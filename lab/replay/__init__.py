"""Replay: the cores of a recorded run get again what they got; counterfactual: under another rule from a time on."""
