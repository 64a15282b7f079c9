"""The documentation: pages beside this file, and what builds them."""
