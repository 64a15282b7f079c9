"""The running loop hurt on purpose: how soon it stops, and whether it comes back."""
