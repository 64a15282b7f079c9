"""A world's route as a route file, the form in which the navigator reads routes."""

from paani_sim.worlds import World


def route_toml(world: World) -> str:
    """TOML text with the world's name, the map's origin and its waypoints in map metres."""
    waypoints = "".join(
        f"\n[[waypoints]]\nx_m = {x_m:.4f}\ny_m = {y_m:.4f}\n" for x_m, y_m in world.route_m.tolist()
    )
    return (
        f'name = "{world.name}"\nrepeat = true\n\n'
        f"[origin]\nlatitude_deg = {world.origin_lat_deg}\nlongitude_deg = {world.origin_lon_deg}\n"
        f"{waypoints}"
    )
