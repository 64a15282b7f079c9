"""Judging pictures at the desk: the boat's own eyes and verdict, without bus or simulator."""
