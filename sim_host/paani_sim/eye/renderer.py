"""The rendered camera: a picture of the world from the boat, and its labels.

One mirrored pass for the reflections, then sky, land, plants and things, then the water, shaded by
slope, wind, mirror image and sky. Deterministic for world, pose, time and light.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from types import TracebackType

import cv2
import numpy as np
import numpy.typing as npt

from paani_sim.eye import gl as g
from paani_sim.eye import shaders
from paani_sim.eye.camera import BoatPose, Camera, look_from, view_projection
from paani_sim.eye.chunks import Chunks, make_chunks, visible
from paani_sim.eye.labels import Labelled, read_labels
from paani_sim.eye.lens import Lens
from paani_sim.eye.scene import (
    FIRST_THING,
    PLANT_WIDTHS,
    ROW_WIDTHS,
    Scene,
    Thing,
    make_scene,
    obstacle_rows,
)
from paani_sim.eye.sky import Sky, paint_sky
from paani_sim.eye.sprites import paint_sprites
from paani_sim.eye.surfaces import SPAN_M, surface_tiles
from paani_sim.eye.waves import mean_square_slope, noise_tile, slope_tile
from paani_sim.worlds.world import Light, Obstacle, Wind, World, actor_at, along_at

F32 = npt.NDArray[np.float32]
_NOISE, _SKY, _SPRITES, _SLOPES, _MIRROR, _MAIN, _SURFACES = 0, 1, 2, 3, 4, 6, 8
_FLAT = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], np.float32)
_QUAD = np.array([0, 1, 2, 0, 2, 3], np.uint32)
_IDENTITY = np.eye(4, dtype=np.float32)


@dataclass(frozen=True, eq=False)
class Picture:
    """`bgr` `(height, width, 3)` uint8."""

    bgr: npt.NDArray[np.uint8]


class Eye:
    """Off-screen renderer of one world. Make, use and close it in one thread.

    `supersample` renders that many times larger each way and averages. `camera` (of the same size)
    and `exposure` may be changed between pictures.
    Raises `UserError` where OpenGL is missing.
    """

    def __init__(
        self,
        world: World,
        camera: Camera | None = None,
        *,
        supersample: float = 1.5,
        exposure: float = 1.1,
        context: g.Context | None = None,
    ) -> None:
        self.world = world
        self.camera = camera or Camera()
        self._scale = supersample
        self.exposure = exposure
        self._owned = context is None
        self._context = context or g.Context()
        self._gl = gl = self._context.gl
        self.scene: Scene = make_scene(world)
        self.things: tuple[Thing, ...] = self.scene.things
        self._lens = Lens(self.camera.width_px, self.camera.height_px, world.seed)
        self._programs = {
            "solid": g.Program(gl, shaders.SOLID_VERTEX, shaders.SOLID_FRAGMENT),
            "plant": g.Program(gl, shaders.PLANT_VERTEX, shaders.PLANT_FRAGMENT),
            "sky": g.Program(gl, shaders.SCREEN_VERTEX, shaders.SKY_FRAGMENT),
            "water": g.Program(gl, shaders.WATER_VERTEX, shaders.WATER_FRAGMENT),
        }
        for program in self._programs.values():
            for name, unit in (
                ("noiseTile", _NOISE),
                ("panorama", _SKY),
                ("sprites", _SPRITES),
                ("slopes", _SLOPES),
                ("surfaces", _SURFACES),
                ("mirrorView", _MIRROR),
            ):
                program.sampler(name, unit)
        self._upload()
        self.set_weather(world.light, world.wind)

    def _upload(self) -> None:
        gl, scene = self._gl, self.scene
        g.make_texture(gl, noise_tile(self.world.seed), _NOISE)
        g.make_texture(gl, paint_sprites(self.world.seed, self.world.season_frac), _SPRITES, wrap_u=False, wrap_v=False)
        g.make_texture(gl, surface_tiles(self.world.seed), _SURFACES)
        g.make_texture(gl, slope_tile(self.world.seed), _SLOPES)
        width, height = self.camera.width_px, self.camera.height_px
        self._mirror = g.make_target(gl, width, height, _MIRROR)
        self._main = g.make_target(gl, round(width * self._scale), round(height * self._scale), _MAIN)
        still, plants = scene.still, scene.plants
        place_m, reach_m = plants.rows[:, :2].astype(float), 0.5 * plants.rows[:, 3].astype(float)
        self._still_chunks = make_chunks(still.rows[:, :2].astype(float), still.order, np.zeros(len(still.rows)))
        self._plant_chunks = make_chunks(place_m, plants.order, reach_m)
        self._still = g.make_batch(gl, still.rows, ROW_WIDTHS, self._still_chunks.order)
        self._plants = g.make_batch(gl, plants.rows, PLANT_WIDTHS, self._plant_chunks.order)
        self._actors = [(actor, g.make_batch(gl, rows.rows, ROW_WIDTHS, rows.order)) for actor, rows in scene.actors]
        self._screen = g.make_batch(gl, _FLAT, (2,), _QUAD)
        self._extra: g.Batch | None = None
        self._sky_texture: int | None = None

    def set_weather(self, light: Light, wind: Wind) -> None:
        """Change sky, sun and wind."""
        self._context.make_current()
        self._sky: Sky = paint_sky(light)
        if self._sky_texture is not None:
            self._gl.glDeleteTextures(1, [self._sky_texture])
        self._sky_texture = g.make_texture(self._gl, self._sky.panorama, _SKY, wrap_v=False)
        way = np.array([np.cos(wind.toward_rad), np.sin(wind.toward_rad)], np.float32)
        body = np.asarray(self.world.water_rgb, np.float32) ** 2
        self._weather: dict[str, float | F32] = {
            "sun": self._sky.sun_direction,
            "sunRgb": self._sky.sun_rgb,
            "skyRgb": self._sky.ambient_rgb,
            "hazeRgb": self._sky.horizon_rgb,
            "visibility": light.visibility_m,
            "windWay": way,
            "slopeRms": float(np.sqrt(mean_square_slope(wind.speed_mps))),
            "bodyRgb": body,
            "flow": np.zeros(2, np.float32),
            "tilesPerMetre": np.divide(1.0, SPAN_M[1:], dtype=np.float32),
        }

    def place(self, obstacles: Sequence[Obstacle]) -> None:
        """Add obstacles to those of the world, in place of any added before."""
        self._context.make_current()
        if self._extra is not None:
            g.drop_batch(self._gl, self._extra)
        rows, things = obstacle_rows(obstacles, FIRST_THING + len(self.scene.things))
        self._extra = g.make_batch(self._gl, rows.rows, ROW_WIDTHS, rows.order)
        self.things = (*self.scene.things, *things)

    def render(self, pose: BoatPose, t_s: float, actors_along_m: Sequence[float] = ()) -> Picture:
        """The picture at simulated time `t_s`, waves included.

        Actors are `actors_along_m` down their paths, in the world's order; empty: as far as time says.
        """
        self._draw(pose, t_s, actors_along_m)
        return Picture(self._develop(t_s))

    def render_labelled(self, pose: BoatPose, t_s: float, actors_along_m: Sequence[float] = ()) -> Labelled:
        """The picture with its class mask and the boxes of what is visible."""
        self._draw(pose, t_s, actors_along_m)
        labels = g.read_target(self._gl, self._main, 1)
        rows, columns = (
            ((np.arange(count) + 0.5) * self._scale).astype(int)
            for count in (self.camera.height_px, self.camera.width_px)
        )
        labels = labels[rows[:, None], columns[None, :]]
        return read_labels(self._develop(t_s), labels, self.things)

    def _develop(self, t_s: float) -> npt.NDArray[np.uint8]:
        raw = g.read_target(self._gl, self._main, 0)
        size = (self.camera.width_px, self.camera.height_px)
        bgr = cv2.cvtColor(raw, cv2.COLOR_BGRA2BGR)
        if self._scale != 1.0:
            bgr = cv2.resize(bgr, size, interpolation=cv2.INTER_AREA)
        return self._lens.apply(np.asarray(bgr, np.uint8), round(t_s * 1000.0))

    def _draw(self, pose: BoatPose, t_s: float, actors_along_m: Sequence[float]) -> None:
        gl = self._gl
        self._context.make_current()
        position, _ = look_from(pose, self.camera)
        clip = view_projection(pose, self.camera)
        shared: dict[str, float | F32] = {
            **self._weather,
            "exposure": self.exposure,
            "clipFromMap": clip.astype(np.float32),
            "mapFromClip": np.linalg.inv(clip).astype(np.float32),
            "eye": position.astype(np.float32),
            "time": float(t_s),
            "heading": pose.yaw_rad,
            "screen": np.array([self._main.width_px, self._main.height_px], np.float32),
        }
        along_m = actors_along_m or [along_at(actor, t_s) for actor in self.world.actors]
        moved = [(_model(*actor_at(actor, m)), batch) for (actor, batch), m in zip(self._actors, along_m, strict=True)]
        gl.glEnable(gl.GL_DEPTH_TEST)
        gl.glDepthFunc(gl.GL_LEQUAL)
        gl.glEnable(gl.GL_CLIP_DISTANCE0)
        self._begin(self._mirror, labels=False)
        self._draw_solids(shared, moved, -1.0)
        gl.glActiveTexture(gl.GL_TEXTURE0 + _MIRROR)
        gl.glBindTexture(gl.GL_TEXTURE_2D, self._mirror.colour)
        gl.glGenerateMipmap(gl.GL_TEXTURE_2D)
        gl.glDisable(gl.GL_CLIP_DISTANCE0)
        self._begin(self._main, labels=True)
        self._draw_solids(shared, moved, 1.0)
        self._programs["water"].use(**shared)
        g.draw(gl, self._screen)
        self._programs["sky"].use(**shared)
        g.draw(gl, self._screen)

    def _begin(self, target: g.Target, *, labels: bool) -> None:
        gl = self._gl
        gl.glBindFramebuffer(gl.GL_FRAMEBUFFER, target.frame)
        slots = [gl.GL_COLOR_ATTACHMENT0, gl.GL_COLOR_ATTACHMENT1 if labels else gl.GL_NONE]
        gl.glDrawBuffers(2, slots)
        gl.glViewport(0, 0, target.width_px, target.height_px)
        gl.glClearColor(0.0, 0.0, 0.0, 0.0)
        gl.glClear(gl.GL_COLOR_BUFFER_BIT | gl.GL_DEPTH_BUFFER_BIT)

    def _draw_solids(self, shared: dict[str, float | F32], moved: list[tuple[F32, g.Batch]], flip: float) -> None:
        gl, solid = self._gl, self._programs["solid"]
        solid.use(**shared, flip=flip, mapFromModel=_IDENTITY)
        for model, batch in moved:
            solid.use(mapFromModel=model)
            g.draw(gl, batch)
        solid.use(mapFromModel=_IDENTITY)
        if self._extra is not None:
            g.draw(gl, self._extra)
        self._draw_ahead(self._still, self._still_chunks, shared)
        self._programs["plant"].use(**shared, flip=flip)
        self._draw_ahead(self._plants, self._plant_chunks, shared)

    def _draw_ahead(self, batch: g.Batch, chunks: Chunks, shared: dict[str, float | F32]) -> None:
        """What of a batch can be in the picture, with room for the roll."""
        half_rad = np.arctan(1.35 * np.tan(0.5 * np.radians(self.camera.hfov_deg)))
        found = visible(chunks, np.asarray(shared["eye"], float), float(shared["heading"]), float(half_rad))
        g.draw_chunks(self._gl, batch, chunks.first[found], chunks.count[found])

    def close(self) -> None:
        """Free the OpenGL context, where this eye made it."""
        if self._owned:
            self._context.close()

    def __enter__(self) -> "Eye":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def _model(x_m: float, y_m: float, yaw_rad: float) -> F32:
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    return np.array(
        [[cos, -sin, 0.0, x_m], [sin, cos, 0.0, y_m], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]],
        np.float32,
    )
