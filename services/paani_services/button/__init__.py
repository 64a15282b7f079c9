"""A hardware button on the bus, which asks the operator's process for STOP and for nothing else."""
