"""Pictures of the world, real or rendered, onto the bus."""
