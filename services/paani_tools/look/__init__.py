"""Judging pictures at the desk: the boat's own eyes and judgement, without bus or simulator."""
