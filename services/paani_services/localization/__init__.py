"""Localization: pose and velocity estimated from GPS and IMU by two extended Kalman filters."""
