"""The router: the only process that listens, and the keeper of authority."""
