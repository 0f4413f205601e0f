"""How many sessions find each other, and how soon."""
