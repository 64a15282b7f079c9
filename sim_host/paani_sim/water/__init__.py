"""What the water and the air do to a hull: waves, wakes, wind and current. Pure maths, seeded."""
