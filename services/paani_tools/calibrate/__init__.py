"""`paani calibrate`: how the camera is mounted, from the far waterline and the IMU."""
