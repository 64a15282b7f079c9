"""NMEA 0183 port: position, heading and targets for chart plotters."""
