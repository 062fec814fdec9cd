"""Jitter by rotor order: at one point, over speed, in a run-up, other isolators, many platforms."""
