"""`paani stop`: STOP from the command line, past the page."""
