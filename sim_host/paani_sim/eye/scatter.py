"""Random things in a world's water and on its banks, for pictures with labels. Pure."""

from collections.abc import Sequence

import numpy as np

from paani_sim.eye.boats import BOAT_LOOKS
from paani_sim.eye.camera import BoatPose
from paani_sim.eye.quay import QUAY_TOP_M
from paani_sim.eye.structures import BUOY_LOOKS
from paani_sim.worlds.curves import clearance_m, normals_left, resample_closed
from paani_sim.worlds.world import Bank, Kind, Obstacle, Pose2, World

BOAT_SIZES_M = {
    "rowboat": (3.2, 4.6, 0.37, 0.6),
    "dinghy": (2.8, 4.5, 0.45, 0.9),
    "kayak": (3.6, 5.0, 0.16, 1.1),
    "cruiser": (5.0, 9.0, 0.35, 2.2),
    "sailboat": (5.0, 9.0, 0.31, 8.5),
    "workboat": (6.0, 9.0, 0.36, 2.7),
    "barge": (10.0, 17.0, 0.20, 2.3),
    "pontoonboat": (5.5, 8.0, 0.38, 2.5),
    "narrowboat": (10.0, 18.0, 0.14, 1.8),
    "tug": (9.0, 15.0, 0.32, 6.0),
}  # length from, to; beam over length; height


def gap_m(obstacle: Obstacle, x_m: float, y_m: float) -> float:
    """Distance from a point to the obstacle's footprint, 0 inside it."""
    east, north = x_m - obstacle.pose.x_m, y_m - obstacle.pose.y_m
    cos, sin = np.cos(obstacle.pose.yaw_rad), np.sin(obstacle.pose.yaw_rad)
    ahead = abs(cos * east + sin * north) - 0.5 * obstacle.length_m
    aside = abs(cos * north - sin * east) - 0.5 * obstacle.width_m
    return float(np.hypot(max(ahead, 0.0), max(aside, 0.0)))


NEAR_BANK_FRAC = 0.15


def random_pose(world: World, rng: np.random.Generator) -> BoatPose:
    """The boat somewhere in the water near the route, clear of things, looking down open water or into a bank."""
    if rng.random() < NEAR_BANK_FRAC:
        return _nose_to_bank(world, rng)
    while True:
        along = world.route_m[rng.integers(len(world.route_m))]
        x_m, y_m = along + rng.normal(0.0, 7.0, 2)
        if clearance_m(world.shore_m, np.array([[x_m, y_m]]))[0] < 1.6:
            continue
        if any(gap_m(o, x_m, y_m) < 1.3 for o in world.obstacles if o.kind is not Kind.OTHER):
            continue
        yaws = rng.uniform(-np.pi, np.pi, 4)
        reach = np.array([3.0, 7.0, 14.0, 24.0, 36.0])
        open_m = []
        for yaw in yaws:
            ray = np.array([x_m, y_m]) + reach[:, None] * [np.cos(yaw), np.sin(yaw)]
            open_m.append(float((clearance_m(world.shore_m, ray) > 0.0).sum()))
        best = int(np.argmax(open_m)) if rng.random() < 0.75 else 0
        return BoatPose(
            float(x_m),
            float(y_m),
            float(yaws[best]),
            roll_rad=float(np.clip(rng.normal(0.0, 0.035), -0.14, 0.14)),
            pitch_rad=float(np.clip(rng.normal(0.0, 0.02), -0.06, 0.06)),
        )


def _nose_to_bank(world: World, rng: np.random.Generator) -> BoatPose:
    """The boat with its bow 0.3 to 3.5 m from a bank that it looks into, up to 60 degrees aslant."""
    shore_m = world.shore_m
    edge = int(rng.integers(len(shore_m)))
    along = shore_m[(edge + 1) % len(shore_m)] - shore_m[edge]
    outward = np.array([along[1], -along[0]]) / np.hypot(*along)
    x_m, y_m = shore_m[edge] + 0.5 * along - float(rng.uniform(0.95, 4.1)) * outward
    return BoatPose(
        float(x_m),
        float(y_m),
        float(np.arctan2(outward[1], outward[0]) + rng.uniform(-np.pi / 3, np.pi / 3)),
        roll_rad=float(np.clip(rng.normal(0.0, 0.035), -0.14, 0.14)),
        pitch_rad=float(np.clip(rng.normal(0.0, 0.02), -0.06, 0.06)),
    )


def scatter(world: World, pose: BoatPose, rng: np.random.Generator) -> list[Obstacle]:
    """Boats, buoys, piers and people in front of the boat, none inside another or on the boat."""
    scene = _Scatter(world, pose, rng)
    for _ in range(int(rng.choice([0, 1, 2, 3], p=[0.15, 0.40, 0.30, 0.15]))):
        scene.pier()
    for _ in range(int(rng.integers(0, 4))):
        scene.boat(str(rng.choice(BOAT_LOOKS)))
    for _ in range(int(rng.integers(0, 4))):
        scene.buoy()
    for _ in range(int(rng.integers(0, 3))):
        scene.swimmer()
    for _ in range(int(rng.integers(0, 7))):
        scene.walker()
    return scene.found


class _Scatter:
    def __init__(self, world: World, pose: BoatPose, rng: np.random.Generator) -> None:
        self._world, self._pose, self._rng = world, pose, rng
        self.found: list[Obstacle] = []
        shore = resample_closed(world.shore_m, 1600)
        inward = normals_left(shore, closed=True)
        ahead = shore - [pose.x_m, pose.y_m]
        range_m = np.hypot(ahead[:, 0], ahead[:, 1])
        bearing = np.arctan2(ahead[:, 1], ahead[:, 0]) - pose.yaw_rad
        seen = (np.abs(np.angle(np.exp(1j * bearing))) < 0.62) & (range_m < 45.0) & (range_m > 3.0)
        self._shore, self._inward = shore[seen], inward[seen]

    def _afloat(self, near_m: float, far_m: float) -> tuple[float, float]:
        range_m = near_m * (far_m / near_m) ** self._rng.random()
        bearing = self._pose.yaw_rad + self._rng.uniform(-0.58, 0.58)
        return (
            float(self._pose.x_m + range_m * np.cos(bearing)),
            float(self._pose.y_m + range_m * np.sin(bearing)),
        )

    def _try_placing(self, thing: Obstacle, *, clear_m: float | None, on: Obstacle | None = None) -> bool:
        place = np.array([thing.pose[:2]])
        if clear_m is not None and clearance_m(self._world.shore_m, place)[0] < clear_m:
            return False
        if gap_m(thing, self._pose.x_m, self._pose.y_m) < 1.4:
            return False
        others: Sequence[Obstacle] = [
            o for o in (*self._world.obstacles, *self.found) if o is not on and o.look != "bridge"
        ]
        reach_m = 0.5 * thing.length_m
        for part in (-1.0, -0.5, 0.0, 0.5, 1.0):
            x_m = thing.pose.x_m + part * reach_m * np.cos(thing.pose.yaw_rad)
            y_m = thing.pose.y_m + part * reach_m * np.sin(thing.pose.yaw_rad)
            if any(gap_m(o, x_m, y_m) < 0.5 * thing.width_m + 0.15 for o in others):
                return False
        self.found.append(thing)
        return True

    def _name(self, kind: str) -> str:
        return f"extra_{kind}_{len(self.found)}"

    def boat(self, look: str) -> None:
        """One boat, anywhere afloat ahead."""
        short, long, beam, height = BOAT_SIZES_M[look]
        rng = self._rng
        length = float(rng.uniform(short, long))
        size = (length, length * beam * float(rng.uniform(0.92, 1.1)))
        for _ in range(6):
            x_m, y_m = self._afloat(3.0 + 0.6 * length, 60.0)
            pose = Pose2(x_m, y_m, float(rng.uniform(-np.pi, np.pi)))
            tall = height * float(rng.uniform(0.92, 1.08))
            thing = Obstacle(
                self._name("boat"),
                Kind.VESSEL,
                look,
                pose,
                *size,
                tall,
                variant=int(rng.integers(24)),
            )
            if self._try_placing(thing, clear_m=0.35 * length):
                return

    def buoy(self) -> None:
        """One buoy ahead."""
        rng = self._rng
        look = str(rng.choice(BUOY_LOOKS))
        low, high = {"sphere": (0.35, 1.1), "spar": (0.4, 0.8)}.get(look, (0.5, 1.2))
        width = float(rng.uniform(low, high))
        tall = width * {"sphere": 0.9, "can": 1.6, "cone": 1.7, "pillar": 2.7, "spar": 3.2}[look]
        for _ in range(6):
            x_m, y_m = self._afloat(2.2, 40.0)
            thing = Obstacle(
                self._name("buoy"),
                Kind.BUOY,
                look,
                Pose2(x_m, y_m, 0.3),
                width,
                width,
                tall,
                variant=int(rng.integers(12)),
            )
            if self._try_placing(thing, clear_m=0.8):
                return

    def swimmer(self) -> None:
        """One swimmer ahead."""
        for _ in range(6):
            x_m, y_m = self._afloat(2.4, 18.0)
            pose = Pose2(x_m, y_m, float(self._rng.uniform(-np.pi, np.pi)))
            thing = Obstacle(
                self._name("swimmer"),
                Kind.PERSON,
                "swimming",
                pose,
                1.1,
                0.6,
                0.4,
                variant=int(self._rng.integers(42)),
            )
            if self._try_placing(thing, clear_m=0.6):
                return

    def walker(self) -> None:
        """Somebody standing, walking or sitting on the bank."""
        if len(self._shore) == 0:
            return
        for _ in range(6):
            index = int(self._rng.integers(len(self._shore)))
            off_m = float(self._rng.uniform(0.7, 3.0))
            x_m, y_m = self._shore[index] - off_m * self._inward[index]
            base_m = 0.75 * (1.0 - float(np.exp(-off_m / 1.6))) + 0.035 * off_m
            if self._world.bank is Bank.QUAY:
                base_m = QUAY_TOP_M
            if self._person(float(x_m), float(y_m), base_m, None):
                return

    def _person(self, x_m: float, y_m: float, base_m: float, on: Obstacle | None) -> bool:
        rng = self._rng
        look = str(rng.choice(["standing", "walking", "sitting"], p=[0.5, 0.3, 0.2]))
        tall = 1.2 if look == "sitting" else float(rng.uniform(1.2, 1.9))
        pose = Pose2(x_m, y_m, float(rng.uniform(-np.pi, np.pi)))
        thing = Obstacle(
            self._name("person"),
            Kind.PERSON,
            look,
            pose,
            0.5,
            0.5,
            tall,
            base_m,
            int(rng.integers(42)),
        )
        return self._try_placing(thing, clear_m=None, on=on)

    def pier(self) -> None:
        """A jetty out from the bank, or a pontoon or quay along it, perhaps with people on it."""
        if len(self._shore) == 0:
            return
        rng = self._rng
        quayed = self._world.bank is Bank.QUAY
        looks = (
            ("finger", "pontoon", "quay_steps", "jetty") if quayed else ("jetty", "jetty", "pontoon", "finger", "quay")
        )
        look = str(rng.choice(looks))
        for _ in range(8):
            index = int(rng.integers(len(self._shore)))
            inward = self._inward[index]
            across = float(np.arctan2(inward[1], inward[0]))
            length, width = float(rng.uniform(5.0, 12.0)), float(rng.uniform(1.3, 2.8))
            if look == "quay_steps":
                length = float(rng.uniform(2.2, 3.2))
            if look in {"jetty", "finger", "quay_steps"} or (look == "pontoon" and rng.random() < 0.5):
                off_m, yaw = 0.5 * length - (0.1 if quayed else 1.2), across
            else:
                off_m, yaw = 0.5 * width + (0.1 if quayed else -0.2), across + 0.5 * np.pi
            if look == "finger":
                width = float(rng.uniform(0.8, 1.4))
            tall = {"jetty": 0.8, "pontoon": 0.45, "finger": 0.4, "quay": 1.1, "quay_steps": QUAY_TOP_M}[look]
            tall *= 1.0 if look == "quay_steps" else float(rng.uniform(0.8, 1.3))
            x_m, y_m = self._shore[index] + off_m * inward
            pose = Pose2(float(x_m), float(y_m), yaw + float(rng.normal(0.0, 0.08)))
            thing = Obstacle(
                self._name("pier"),
                Kind.PIER,
                look,
                pose,
                length,
                width,
                tall,
                variant=int(rng.integers(6)),
            )
            if not self._try_placing(thing, clear_m=None):
                continue
            for _ in range(0 if look == "quay_steps" else int(rng.integers(0, 4))):
                part = float(rng.uniform(-0.3, 0.45)) * length
                side = float(rng.uniform(-0.3, 0.3)) * width
                cos, sin = np.cos(pose.yaw_rad), np.sin(pose.yaw_rad)
                self._person(
                    float(x_m + part * cos - side * sin),
                    float(y_m + part * sin + side * cos),
                    tall,
                    thing,
                )
            return
