"""One picture to evidence: usable or not, boxes, corridors of water."""
