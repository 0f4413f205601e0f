"""The plant beside other simulators, and beside itself at smaller steps: the numbers of docs/validation.md."""
