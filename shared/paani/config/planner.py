"""Where the camera is on the boat, and the metric planner's settings.

Ids such as `J7` name statements of the paper (`paani claims`).
"""

from __future__ import annotations

from typing import Annotated

import msgspec

from paani.config.section import Fraction, NonNegative, Offset, Positive, Section, Tilt
from paani.config.simulator import EyeConfig

FieldOfView = Annotated[float, msgspec.Meta(ge=0.0, le=170.0)]
Reach = Annotated[float, msgspec.Meta(ge=0.0, le=3.8)]  # the planner knows distances to 4 m
Height = Annotated[float, msgspec.Meta(ge=0.0, le=30.0)]
Angle = Annotated[float, msgspec.Meta(gt=0.0, le=180.0)]


class CalibrationConfig(Section, frozen=True):
    """A pinhole with square pixels, fixed to the boat; the simulator's own is `calibration_of` the eye.

    `hfov_deg`: horizontal field of view (0: unknown); the focal length is 0.5 / tan(hfov / 2) picture widths.
    `centre_frac`: where the optical axis meets the picture, of its width and height from the top left.
    `height_m`: above the water, boat at rest; `forward_m`: ahead of the point whose position the odometry gives.
    Mount: `pitch_down_deg` looks down, `roll_deg` starboard down, `yaw_deg` to port.
    `valid`: somebody measured all of it; the metric planner acts on nothing less. `measured_by`: who, or what.
    """

    valid: bool = False
    hfov_deg: FieldOfView = 0.0
    centre_frac: tuple[Fraction, Fraction] = (0.5, 0.5)
    height_m: Height = 0.0
    forward_m: Offset = 0.0
    pitch_down_deg: Tilt = 0.0
    roll_deg: Tilt = 0.0
    yaw_deg: Tilt = 0.0
    measured_by: Annotated[str, msgspec.Meta(max_length=200)] = ""

    def __post_init__(self) -> None:
        """What is valid says how wide the camera sees, and from how high."""
        for name in ("hfov_deg", "height_m"):
            if self.valid and getattr(self, name) <= 0.0:
                raise ValueError(f"valid: {name} is not known")


def calibration_of(eye: EyeConfig) -> CalibrationConfig:
    """What the simulator's camera is."""
    return CalibrationConfig(
        valid=eye.hfov_deg <= 170.0 and eye.camera_height_m <= 30.0,
        hfov_deg=min(eye.hfov_deg, 170.0),
        height_m=min(eye.camera_height_m, 30.0),
        forward_m=eye.camera_forward_m,
        pitch_down_deg=eye.pitch_down_deg,
        measured_by="the simulator",
    )


class PlannerConfig(Section, frozen=True):
    """The local planner and its map of the water around the boat. It acts on a valid calibration alone.

    `blind_m`: the blind zone beside the boat counts as water up to here, unless an obstacle was last seen in it.
    A camera that is blind beyond it leaves the zone unknown.
    `outvoted_by`: so many later pictures that show water free a cell that one picture alone shows occupied: a glint; 0:
    never.
    `hidden_s`: a cell that was last seen occupied stays so this long while the camera looks elsewhere; 0: Q3 alone. The
    obstacle may have come `hidden_drift_m` nearer meanwhile.
    `person_mps`: speed of a person who may swim out of sight, over `person_reach_m` at most. An unseen vessel drifts
    at `drift_mps`, over `vessel_reach_m` at most.
    `horizon_slack_deg`: water seen this far above the horizon is no water, and nothing in its column counts.
    `look_m`: obstacles that far along a path, but beyond `horizon_s`, add to the cost and forbid nothing.
    `predict`: dynamic obstacles count where they are predicted to be. Velocities are fitted over `fit_s`, up to
    `mover_range_m` away, and predict an obstacle for `unseen_s` out of sight.
    `scan_max_age_s`: of a range scan whose echoes are obstacles; 0: none is.
    `ais_max_age_s`: of what a vessel told of itself by AIS, to be counted where the camera does not look; 0: never.
    `min_depth_m`: water that an echo sounder finds shallower, or expects to be by how the bottom rises, is an obstacle;
    0: soundings do not count. One older than `sounding_max_age_s` does not.
    `barred_s`: without headway along its path for so long, the desired course leads round what bars it; 0: never.
    `patience_s`: the longest that the boat waits for dynamic obstacles to pass.
    `person_near_m`, `vessel_near_m`: room kept free around dynamic obstacles. `lead_s`: candidates that come near where
    an obstacle will be so much later cost more, those that pass astern do not.
    `room_m`: length of free path that a boat must keep ahead, to be able to turn away. `turn_radius_m`: radius of the
    tightest circle at any speed; `helm_speed_mps`: speed that steering alone causes with thrusters that only push.
    `drag_per_s`, `drag_per_m`: deceleration with the thrusters off, per speed and per its square.
    `brake_s`: a boat under way with no feasible candidate is ordered to brake for this long; then it gets no thrust.
    `stop_s`: stopping distance over speed, the age of the picture included; nothing within it may be unknown.
    """

    use: bool = True  # whether the metric planner steers; without it the advice turns the boat by angles
    max_range_m: Positive = 8.0  # one mask row is 1.2 m there, seen from 0.9 m
    blind_m: NonNegative = 3.0
    horizon_slack_deg: NonNegative = 4.0
    free_s: Positive = 0.8  # Q3
    occupied_s: Positive = 2.0  # Q3
    outvoted_by: Annotated[int, msgspec.Meta(ge=0, le=10_000)] = 2
    hidden_s: NonNegative = 120.0  # measured: a boat that lies there is 0.24 m off by dead reckoning, in each axis
    hidden_drift_m: NonNegative = 0.45  # Q6's drift allowance for 3 s, and 1.9 deviations after `hidden_s`
    thickness_m: Positive = 0.4  # of what ends the water, away from the boat
    person_room_m: NonNegative = 0.8  # kept around people: a swimmer's distance within `horizon_s`
    person_mps: NonNegative = 0.4  # of a swimmer at ease
    person_reach_m: Reach = 3.6
    vessel_reach_m: Reach = 1.2  # measured: a vessel adrift comes 0.5 to 1.5 m nearer while it is passed
    predict: bool = True
    mover_range_m: Positive = 20.0  # one row of the picture is 1.8 m there, and a barge is there in 9 s
    fit_s: Positive = 2.5
    unseen_s: NonNegative = 30.0
    scan_max_age_s: NonNegative = 0.5  # two turns of the slowest scanner, and one that is lost
    ais_max_age_s: NonNegative = 20.0  # a class A transponder speaks every 10 s, and one report may be lost
    min_depth_m: NonNegative = 0.6  # draught of 0.19 m, a common sounder's blind zone of 0.3 m, and a wave
    sounding_max_age_s: Positive = 2.0  # the slowest sounders speak once a second, and one sounding may be lost
    barred_s: NonNegative = 8.0  # half of `patience_s`: what passes is waited for where no way leads round it
    patience_s: NonNegative = 15.0  # in which a swimmer at ease passes 6 m
    lead_s: NonNegative = 2.0
    person_near_m: NonNegative = 0.5  # half a swimmer, and what a stroke takes
    vessel_near_m: NonNegative = 0.2
    max_pose_gap_s: Positive = 0.15  # between a picture and the odometry that gives its pose
    max_reckon_s: Positive = 0.5  # without odometry for longer, all observations are forgotten
    horizon_s: Positive = 3.0  # Q4
    step_s: Positive = 0.2  # Q4
    look_m: NonNegative = 5.0  # a quarter turn at `turn_radius_m`, the boat, and as much again
    speed_mps: Positive = 0.6  # cap while the planner steers; the paper has 0.4 (Q5)
    yaw_rate_radps: Positive = 0.35  # Q5
    yaw_accel_radps2: Positive = 0.35  # a second to the full turn rate
    accel_mps2: Positive = 0.4  # measured on K4, K5; the paper has 0.2 (Q5)
    drag_per_s: NonNegative = 4.0 / 12.4  # K5 over K4
    drag_per_m: NonNegative = 20.0 / 12.4  # K5 over K4
    turn_radius_m: NonNegative = 0.0  # Q5
    room_m: NonNegative = 1.5  # hull_radius_m, margin_m and what braking from half speed takes
    helm_speed_mps: NonNegative = 0.0  # Q5
    hull_radius_m: Positive = 0.55  # Q6
    margin_m: NonNegative = 0.7  # measured: least near misses in trials by camera
    tight_margin_m: NonNegative = 0.25  # Q6; kept where no candidate keeps the whole margin
    drift_mps: NonNegative = 0.15  # Q6
    brake_s: NonNegative = 1.5  # measured: 0.9 s from 0.6 m/s; picture and order before
    stop_s: Positive = 2.5  # measured: K5 drag stops 0.6 m/s in 0.9 m; 0.5 s of picture and order before
    replan_s: Positive = 0.25  # age of a plan, at most, while no new picture comes
    span_deg: Angle = 120.0  # headings to either side of the desired course
    # Between the sampled headings: the time that a plan takes is proportional to their number.
    spacing_deg: Annotated[float, msgspec.Meta(ge=2.0, le=60.0)] = 10.0

    def acts_on(self, calibration: CalibrationConfig) -> bool:
        """Whether the planner steers: it does not without a valid calibration."""
        return self.use and calibration.valid
