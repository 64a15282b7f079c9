"""Recorder: every message on the bus, in MCAP files that survive a crash."""
