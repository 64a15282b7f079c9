"""Dashboard: the operator's page with its STOP, and the operator's messages on the bus."""
