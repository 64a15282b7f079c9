"""`paani doctor`: what this machine lacks to run a boat."""
