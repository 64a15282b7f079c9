"""Files to begin with; README.md says what each is for."""
