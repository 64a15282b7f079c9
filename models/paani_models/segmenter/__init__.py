"""The water segmenter: networks, losses, training and scores."""
