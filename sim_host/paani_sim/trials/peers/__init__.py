"""Planners that a user would pick instead, on the same map and tracks as the navigator's own."""
