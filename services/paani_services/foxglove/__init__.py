"""Foxglove port: the running boat in Foxglove and Lichtblick. Viewers watch; they change nothing."""
