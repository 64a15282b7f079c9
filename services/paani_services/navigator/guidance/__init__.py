"""Guidance: the desired course and speed from the mission (path following, integral line of sight) and the advice."""
