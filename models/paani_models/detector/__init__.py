"""The obstacle detector: networks, losses, training and scores."""
