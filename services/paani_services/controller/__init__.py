"""Speed and heading controller: an order to the normalised thrust of two fans."""
