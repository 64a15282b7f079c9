"""Drives again: republished in time, computed again to the byte, or computed with other settings."""
