"""GPS, IMU and heading devices of a real hull."""
