"""The compiled inner loop: inverter models, network solution, and the step that joins them."""
