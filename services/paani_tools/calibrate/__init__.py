"""`paani calibrate`: how the camera is mounted, and what the hull does."""
