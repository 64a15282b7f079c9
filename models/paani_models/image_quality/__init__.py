"""The network that says whether a picture is fit to be evidence: its shape, data and training."""
