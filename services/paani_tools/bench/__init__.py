"""`paani bench`."""
