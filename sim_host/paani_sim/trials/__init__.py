"""Seeded drives in lockstep: the processes' own cores on one simulated clock, scored."""
