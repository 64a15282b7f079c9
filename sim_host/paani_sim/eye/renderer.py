"""The rendered camera: a picture of the world from the boat, and its labels.

One mirrored pass for the reflections, then sky, land, plants and things, then the water, shaded by
slope, wind, mirror image and sky. Deterministic for world, pose, time and light.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from types import ModuleType, TracebackType
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from paani.arrays import F32, F64, U8
from paani_sim.eye import gl as g
from paani_sim.eye import shaders, water_patches
from paani_sim.eye.camera import BoatPose, Camera, camera_pose, linear_depth_m, view_projection
from paani_sim.eye.chunks import Chunks, find_visible, is_in_view, make_chunks
from paani_sim.eye.labels import Labelled, read_labels
from paani_sim.eye.lens import NEUTRAL, Lens
from paani_sim.eye.mesh import rotation
from paani_sim.eye.optics import Optics
from paani_sim.eye.rain import Rain
from paani_sim.eye.scene import (
    FIRST_THING,
    PLANT_WIDTHS,
    ROW_WIDTHS,
    MovableRows,
    Rows,
    Scene,
    Thing,
    make_scene,
    place_obstacles,
)
from paani_sim.eye.sky import Sky, paint_sky
from paani_sim.eye.sprites import paint_sprites
from paani_sim.eye.surfaces import surface_tiles
from paani_sim.eye.wave_motion import compute_wave_motion, wind_sea_state
from paani_sim.eye.wave_textures import noise_tile, slope_tile
from paani_sim.eye.weather import Uniforms, uniforms
from paani_sim.worlds.world import Actor, Light, Obstacle, Pose2, Wind, World, actor_distance_along_m, actor_pose_along

_NOISE, _SKY, _SPRITES, _SLOPES, _MIRROR, _STIRRED, _SURFACES, _MAIN = range(8)  # texture units; _MAIN takes two
DETAILS_WITHIN_M = 80.0
SHADOWS_WITHIN_M = 40.0
SAME_SURFACE_FRAC = 0.05
MIRRORED_WITHIN_M = 120.0
_PAINTED_WORLDS = 2  # painting is half of what an eye costs to open, and drives of one world follow each other
_SCREEN_CORNERS = water_patches.CORNERS.astype(np.float32)
_IDENTITY = np.eye(4, dtype=np.float32)


@dataclass(frozen=True, eq=False)
class Picture:
    """`bgr` `(height, width, 3)` uint8."""

    bgr: npt.NDArray[np.uint8]


class _Solid:
    """Triangles with one place: drawn chunk by chunk, those in the picture."""

    def __init__(self, gl: ModuleType, rows: Rows, widths: tuple[int, ...], reach_m: float | F64 = 0.0) -> None:
        place_m = rows.rows[:, :3].astype(float)
        self.chunks: Chunks = make_chunks(place_m, rows.order, np.broadcast_to(reach_m, place_m.shape))
        self.batch = g.make_batch(gl, rows.rows, widths, self.chunks.order)


class _Movable(NamedTuple):
    """A thing that moves; `reach_m` is how far it extends from its origin, any way."""

    thing: Obstacle | Actor
    batch: g.Batch
    reach_m: float


@functools.lru_cache(_PAINTED_WORLDS)
def _paint_textures(seed: int, season_frac: float) -> tuple[U8, U8, U8, U8]:
    """Noise, sprites, slopes and surfaces."""
    return noise_tile(seed), paint_sprites(seed, season_frac), slope_tile(seed), surface_tiles(seed)


class Eye:
    """Off-screen renderer of one world. Make, use and close it in one thread.

    `supersample` renders that many times larger each way and averages. `camera` (of the same size)
    and `exposure` may be changed between pictures. `balance` is the camera's gain of blue, green and red.
    Raises `UserError` where OpenGL is missing or the camera's lens cannot be.
    """

    def __init__(
        self,
        world: World,
        camera: Camera | None = None,
        *,
        supersample: float = 1.25,
        exposure: float = 1.1,
        balance: tuple[float, float, float] = NEUTRAL,
        context: g.Context | None = None,
    ) -> None:
        self.world = world
        self.camera = camera or Camera()
        self._scale = supersample
        self.exposure = exposure
        self._optics = Optics(self.camera, supersample)
        self._optics_camera = self.camera
        self._owned = context is None
        self._context = context or g.Context()
        self._gl = gl = self._context.gl
        self.scene: Scene = make_scene(world)
        self.things: tuple[Thing, ...] = self.scene.things
        width, height = self.camera.width_px, self.camera.height_px
        self._lens = Lens(width, height, world.seed, balance)
        self._rain = Rain(width, height, world.seed)
        self._programs = {
            "solid": g.Program(gl, shaders.SOLID_VERTEX, shaders.SOLID_FRAGMENT),
            "plant": g.Program(gl, shaders.PLANT_VERTEX, shaders.PLANT_FRAGMENT),
            "stir": g.Program(gl, shaders.PATCH_VERTEX, shaders.STIR_FRAGMENT),
            "shade": g.Program(gl, shaders.PATCH_VERTEX, shaders.SHADE_FRAGMENT),
            "sky": g.Program(gl, shaders.SCREEN_VERTEX, shaders.SKY_FRAGMENT),
            "water": g.Program(gl, shaders.WATER_VERTEX, shaders.WATER_FRAGMENT),
        }
        for program in self._programs.values():
            for name, unit in (
                ("noiseTile", _NOISE),
                ("panorama", _SKY),
                ("sprites", _SPRITES),
                ("slopes", _SLOPES),
                ("mirrorView", _MIRROR),
                ("stirred", _STIRRED),
                ("surfaces", _SURFACES),
            ):
                program.sampler(name, unit)
        self._upload()
        self.set_weather(world.light, world.wind)

    def _upload(self) -> None:
        gl, scene = self._gl, self.scene
        noise, sprites, slopes, surfaces = _paint_textures(self.world.seed, self.world.season_frac)
        g.make_texture(gl, noise, _NOISE, between_levels=False)
        g.make_texture(gl, sprites, _SPRITES, wrap_u=False, wrap_v=False)
        g.make_texture(gl, slopes, _SLOPES, between_levels=False)
        g.make_texture(gl, surfaces, _SURFACES, between_levels=False)
        width, height = self.camera.width_px, self.camera.height_px
        self._mirror = g.make_target(gl, width // 2, height // 2, _MIRROR, slots=1)  # water blurs it twice over
        self._stirred = g.make_target(gl, width, height, _STIRRED, slots=1, fine=True)
        self._main = g.make_target(gl, round(width * self._scale), round(height * self._scale), _MAIN)
        self._still = _Solid(gl, scene.still, ROW_WIDTHS)
        self._details = _Solid(gl, scene.details, ROW_WIDTHS)
        wide_m, tall_m = scene.plants.rows[:, 3:5].astype(float).T
        self._plants = _Solid(gl, scene.plants, PLANT_WIDTHS, np.stack([wide_m, wide_m, tall_m], axis=1))
        self._afloat, self._actors = self._upload_movables(scene.afloat), self._upload_movables(scene.actors)
        self._screen = g.make_batch(gl, _SCREEN_CORNERS, (2,), water_patches.QUAD)
        self._shadows: _Solid | None = None
        self._extra: tuple[Obstacle, ...] = ()
        self._extra_still: g.Batch | None = None
        self._extra_afloat: list[_Movable] = []
        self._sky_texture: int | None = None

    def _upload_movables(self, owned: Sequence[MovableRows]) -> list[_Movable]:
        return [
            _Movable(
                o.thing,
                g.make_batch(self._gl, o.rows.rows, ROW_WIDTHS, o.rows.order),
                float(np.linalg.norm(o.rows.rows[:, :3], axis=1).max(initial=0.0)),
            )
            for o in owned
        ]

    def set_weather(self, light: Light, wind: Wind) -> None:
        """Change sky, sun, rain and wind."""
        self._context.make_current()
        self._sky: Sky = paint_sky(light)
        if self._sky_texture is not None:
            self._gl.glDeleteTextures(1, [self._sky_texture])
        self._sky_texture = g.make_texture(self._gl, self._sky.panorama, _SKY, wrap_v=False, between_levels=False)
        self._light = light
        self._sea = wind_sea_state(wind, self.world.waves)
        self._weather: Uniforms = uniforms(self.world, light, wind, self._sky)
        self._cast = water_patches.shadow_cast_per_m(self._sky.sun_direction)
        self._update_shadows()

    def _update_shadows(self) -> None:
        if self._shadows is not None:
            g.drop_batch(self._gl, self._shadows.batch)
        standing = water_patches.standing_shadows((*self.world.obstacles, *self._extra), self._cast)
        rows = np.concatenate([water_patches.tree_shadows(self.scene.grown, self._cast), standing]).astype(np.float32)
        patches = Rows(rows, water_patches.patch_order(len(rows)))
        self._shadows = _Solid(self._gl, patches, water_patches.PATCH_WIDTHS)

    def place_obstacles(self, obstacles: Sequence[Obstacle]) -> None:
        """Add obstacles to those of the world, in place of any added before."""
        self._context.make_current()
        for batch in [self._extra_still, *(a.batch for a in self._extra_afloat)]:
            if batch is not None:
                g.drop_batch(self._gl, batch)
        new = place_obstacles(obstacles, FIRST_THING + len(self.scene.things))
        self._extra = tuple(obstacles)
        self._extra_still = g.make_batch(self._gl, new.still.rows, ROW_WIDTHS, new.still.order)
        self._extra_afloat = self._upload_movables(new.afloat)
        self.things = (*self.scene.things, *new.things)
        self._update_shadows()

    def render(self, pose: BoatPose, t_s: float, actors_along_m: Sequence[float] = ()) -> Picture:
        """The picture at simulated time `t_s`, waves included.

        Actors are `actors_along_m` down their paths, in the world's order; empty: as far as time says.
        """
        self._draw(pose, t_s, actors_along_m, slots=1)
        return Picture(self._apply_camera_effects(pose, t_s))

    def render_labelled(self, pose: BoatPose, t_s: float, actors_along_m: Sequence[float] = ()) -> Labelled:
        """The picture with its class mask, the boxes of what is visible, and depth."""
        self._draw(pose, t_s, actors_along_m, slots=2)
        labels = np.asarray(self._optics.nearest(g.read_target(self._gl, self._main, 1)), np.uint8)
        return read_labels(self._apply_camera_effects(pose, t_s), labels, self._depth_m(), self.things)

    def _depth_m(self) -> F32:
        """Depth at the middle of each pixel: the buffer is linear across a plane; at edges what is there counts."""
        depth = np.ascontiguousarray(g.read_depth(self._gl, self._main))
        there = linear_depth_m(np.asarray(self._optics.nearest(depth), np.float32))
        between = linear_depth_m(self._optics.middle(depth))
        with np.errstate(invalid="ignore"):
            same = np.abs(between - there) < SAME_SURFACE_FRAC * there
        return np.where(same, between, there)

    def _apply_camera_effects(self, pose: BoatPose, t_s: float) -> npt.NDArray[np.uint8]:
        raw = g.read_target(self._gl, self._main, 0)
        bgr = self._optics.picture(np.asarray(cv2.cvtColor(raw, cv2.COLOR_BGRA2BGR), np.uint8))
        bgr = self._rain.apply(bgr, self._light.rain_mmph, t_s)
        smear_px = self.camera.focal_px * pose.yaw_rate_radps * self.camera.shutter_s
        return self._lens.apply(bgr, round(t_s * 1000.0), smear_px=smear_px)

    def _draw(self, pose: BoatPose, t_s: float, actors_along_m: Sequence[float], slots: int) -> None:
        if self._optics_camera != self.camera:
            self._optics, self._optics_camera = Optics(self.camera, self._scale), self.camera
        gl, camera = self._gl, self._optics.pinhole
        self._context.make_current()
        position, _ = camera_pose(pose, camera)
        clip = view_projection(pose, camera)
        shared: Uniforms = {
            **self._weather,
            "exposure": self.exposure,
            "clipFromMap": clip.astype(np.float32),
            "mapFromClip": np.linalg.inv(clip).astype(np.float32),
            "eye": position.astype(np.float32),
            "time": float(t_s),
            "screen": np.array([self._main.width_px, self._main.height_px], np.float32),
        }
        moved, stir = self._place_movables(t_s, actors_along_m, position, clip)
        gl.glEnable(gl.GL_DEPTH_TEST)
        gl.glDepthFunc(gl.GL_LEQUAL)
        gl.glEnable(gl.GL_CLIP_DISTANCE0)
        g.begin_target(gl, self._mirror, 1)
        self._draw_solids(shared, clip, moved, slots=0)
        gl.glActiveTexture(gl.GL_TEXTURE0 + _MIRROR)
        gl.glBindTexture(gl.GL_TEXTURE_2D, self._mirror.colour)
        gl.glGenerateMipmap(gl.GL_TEXTURE_2D)
        gl.glDisable(gl.GL_CLIP_DISTANCE0)
        self._draw_water_patches(shared, stir)
        g.begin_target(gl, self._main, slots)
        self._draw_solids(shared, clip, moved, slots)
        self._programs["water"].use(**shared)
        g.draw(gl, self._screen)
        self._programs["sky"].use(**shared)
        g.draw(gl, self._screen)

    def _place_movables(
        self, t_s: float, actors_along_m: Sequence[float], eye_m: F64, clip: F64
    ) -> tuple[list[tuple[F32, g.Batch]], F32]:
        """Where every floating thing in the picture is now, and the patches those near leave on the water."""
        found: list[tuple[F32, g.Batch]] = []
        patches = [np.zeros((0, water_patches.COLUMNS))]
        along_m = actors_along_m or [actor_distance_along_m(actor, t_s) for actor in self.world.actors]
        places = [(a, a.thing.pose) for a in (*self._afloat, *self._extra_afloat) if isinstance(a.thing, Obstacle)]
        for a, m in zip(self._actors, along_m, strict=True):
            if isinstance(a.thing, Actor):
                places.append((a, actor_pose_along(a.thing, m)))
                patches.append(water_patches.wake(a.thing, m))
        middle_m = np.array([[pose.x_m, pose.y_m, 0.0] for _, pose in places]).reshape(-1, 3)
        reach_m = np.array([[a.reach_m, a.reach_m, a.reach_m + self._sea.height_m] for a, _ in places]).reshape(-1, 3)
        seen = is_in_view(middle_m, reach_m, clip)
        for (a, pose), drawn in zip(places, seen.tolist(), strict=True):
            if drawn:
                found.append((_model(pose, *compute_wave_motion(self._sea, a.thing, pose, t_s)), a.batch))
            if np.hypot(pose.x_m - eye_m[0], pose.y_m - eye_m[1]) < DETAILS_WITHIN_M:
                patches.append(water_patches.floating_shadow(a.thing, pose, self._cast))
        return found, np.concatenate(patches).astype(np.float32)

    def _draw_water_patches(self, shared: Uniforms, patches: F32) -> None:
        gl = self._gl
        g.begin_target(gl, self._stirred, 1)
        if len(patches) == 0:
            return
        batch = g.make_batch(gl, patches, water_patches.PATCH_WIDTHS, water_patches.patch_order(len(patches)))
        gl.glDisable(gl.GL_DEPTH_TEST)
        gl.glEnable(gl.GL_BLEND)
        gl.glBlendFunc(gl.GL_ONE, gl.GL_ONE)
        self._programs["stir"].use(**shared)
        g.draw(gl, batch)
        gl.glDisable(gl.GL_BLEND)
        gl.glEnable(gl.GL_DEPTH_TEST)
        g.drop_batch(gl, batch)

    def _draw_solids(self, shared: Uniforms, clip: F64, moved: list[tuple[F32, g.Batch]], slots: int) -> None:
        """Everything but water and sky into the current target; without `slots` it is the mirror."""
        gl, solid = self._gl, self._programs["solid"]
        mirrored, eye_m = slots == 0, np.asarray(shared["eye"], float)
        flip = -1.0 if mirrored else 1.0
        if mirrored:
            clip = clip * [1.0, 1.0, -1.0, 1.0]
        solid.use(**shared, flip=flip, mapFromModel=_IDENTITY)
        for model, batch in moved:
            solid.use(mapFromModel=model)
            g.draw(gl, batch)
        solid.use(mapFromModel=_IDENTITY)
        if self._extra_still is not None:
            g.draw(gl, self._extra_still)
        self._draw_visible(self._details, clip, eye_m, DETAILS_WITHIN_M)
        self._draw_visible(self._still, clip, eye_m, MIRRORED_WITHIN_M if mirrored else np.inf)
        if not mirrored and self._shadows is not None:
            gl.glEnable(gl.GL_BLEND)
            gl.glBlendFunc(gl.GL_ZERO, gl.GL_ONE_MINUS_SRC_ALPHA)
            gl.glDepthMask(False)
            g.aim_target(gl, 1)  # shades darken the ground; its labels stay
            self._programs["shade"].use(**shared)
            self._draw_visible(self._shadows, clip, eye_m, SHADOWS_WITHIN_M)
            g.aim_target(gl, slots)
            gl.glDepthMask(True)
            gl.glDisable(gl.GL_BLEND)
        self._programs["plant"].use(**shared, flip=flip)
        self._draw_visible(self._plants, clip, eye_m, np.inf)

    def _draw_visible(self, solid: _Solid, clip: F64, eye_m: F64, within_m: float) -> None:
        """What of a batch can be in the picture."""
        found = find_visible(solid.chunks, clip, eye_m, within_m)
        g.draw_chunks(self._gl, solid.batch, solid.chunks.first[found], solid.chunks.count[found])

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


def _model(pose: Pose2, up_m: float, roll_rad: float, pitch_rad: float) -> F32:
    model = np.eye(4, dtype=np.float32)
    model[:3, :3] = rotation(roll_rad, pitch_rad, pose.yaw_rad)
    model[:3, 3] = (pose.x_m, pose.y_m, up_m)
    return model
