"""The paper's offline scenarios on anybody's pictures, and generated trajectories."""
