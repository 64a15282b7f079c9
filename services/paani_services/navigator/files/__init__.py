"""Files that a navigator reads and writes: routes, missions, fences, GPX, GeoJSON, the mission journal."""
