"""Files that the navigator reads and writes: routes, missions, fences, GPX, GeoJSON, the mission journal."""
