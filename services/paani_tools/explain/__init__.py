"""One recorded decision, told as a person would."""
