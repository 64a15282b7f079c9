"""The operator's process: arming and STOP, asked for by its clients."""
