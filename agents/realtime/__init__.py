"""The agent under real time: it ticks on its own timer with what it heard last. Pure."""
