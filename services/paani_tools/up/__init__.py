"""`paani up`: starts, watches, restarts and sums up all processes."""
