"""INT8 networks: calibration, equalisation, and the rule by which one is accepted."""
