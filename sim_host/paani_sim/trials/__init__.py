"""Seeded drives in lockstep: the cores of the live processes on one simulated clock, scored."""
