"""`paani tune`: other parameters beside those in force, then in their place."""
