"""Live runs: plant and agents in terminals of their own, and commands that watch and change them."""
