"""`paani topics`, `paani echo`, `paani hz`: look at the bus as an observer who cannot write."""
