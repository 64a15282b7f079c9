"""Course and speed from missions and advice: path following, integral line of sight, visual turns."""
