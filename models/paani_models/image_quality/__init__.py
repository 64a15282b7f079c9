"""The image-quality network, which estimates whether a picture is fit to be evidence: architecture, data, training."""
