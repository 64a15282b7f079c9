"""`paani completion`."""
