"""`paani models`: one module per sub-command."""
