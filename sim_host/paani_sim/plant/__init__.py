"""The simulated boat: MuJoCo body, surface dynamics, sensors and the thrust adapter."""
