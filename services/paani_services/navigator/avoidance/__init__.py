"""Keeping clear: candidate trajectories, constraints and costs, the local planner, the fence."""
