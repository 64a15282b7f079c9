"""`paani mission`: another mission or fence for a running boat."""
