"""What the pictures say of the water around the boat: projection, observations, occupancy grid, dynamic obstacles."""
