"""The renderer and camera of the settings, and the boat's pose of a `TruePose` message."""

from paani.config import EyeConfig
from paani.messages import TruePose
from paani_sim.eye.camera import REST_Z_M, BoatPose, Camera
from paani_sim.eye.renderer import Eye
from paani_sim.worlds.world import World


def build_camera(settings: EyeConfig) -> Camera:
    """The configured camera."""
    return Camera(
        width_px=settings.width_px,
        height_px=settings.height_px,
        hfov_deg=settings.hfov_deg,
        forward_m=settings.camera_forward_m,
        up_m=settings.camera_height_m - REST_Z_M,
        down_deg=settings.pitch_down_deg,
        k1=settings.lens_k1,
        k2=settings.lens_k2,
        shutter_s=settings.shutter_s,
    )


def boat_pose(truth: TruePose) -> BoatPose:
    """Where the boat is, how it lies and how fast it turns."""
    lies = (truth.z_m, truth.roll_rad, truth.pitch_rad)
    return BoatPose(truth.x_m, truth.y_m, truth.yaw_rad, *lies, truth.yaw_rate_radps)


def open_eye(world: World, settings: EyeConfig) -> Eye:
    """The eye of the configured camera. Raises `UserError` as `Eye` does."""
    balance = (settings.blue_gain, 1.0, settings.red_gain)
    eye = Eye(world, build_camera(settings), balance=balance)
    eye.exposure *= settings.exposure_frac
    return eye
