"""Heading and speed to normalised differential thrust."""
