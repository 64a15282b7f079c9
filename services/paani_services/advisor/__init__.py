"""Evidence of one picture to an advised direction, with its reasons."""
