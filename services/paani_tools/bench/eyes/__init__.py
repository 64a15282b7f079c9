"""`paani bench eyes`."""
