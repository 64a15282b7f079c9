"""`paani calibrate thrusters`: direction, trim and deadband of both sides, one after the other, boat tied up."""
