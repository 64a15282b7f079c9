"""Recorder: everything on the bus, into files that survive a crash."""
