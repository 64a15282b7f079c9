"""Pose and velocity estimated from GPS and IMU."""
