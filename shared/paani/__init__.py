"""PAANI's contract: messages, keys, authority, configuration, bus, clock, health."""
