"""MAVLink port: the boat to ground stations, and what they ask of it to the operator's process."""
