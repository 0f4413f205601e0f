"""The plant under real time: a clock decides when it advances; agents come and go, people give commands. Pure."""
