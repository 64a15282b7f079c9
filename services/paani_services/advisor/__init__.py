"""The advisor: from the evidence of one picture to an advised direction with its reasons."""
