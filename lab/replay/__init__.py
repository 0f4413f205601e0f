"""A replay gives the cores of a recorded run their inputs again; a counterfactual changes the rule from a time on."""
