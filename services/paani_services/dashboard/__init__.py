"""The operator's page: what the boat sees, thinks and does; one STOP."""
