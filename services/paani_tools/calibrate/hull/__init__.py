"""`paani calibrate hull`: drag, turning and thrust of a hull from a recorded drive (W11)."""
