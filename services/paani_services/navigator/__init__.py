"""The advisor's direction and the route to one heading and speed."""
