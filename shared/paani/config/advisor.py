"""Advisor settings.

Ids such as `J7` name statements of the paper (`paani claims`).
"""

from __future__ import annotations

from typing import Annotated

import msgspec

from paani.config.section import Fraction, NonNegative, Positive, Section, Size

RemovalSize = Annotated[int, msgspec.Meta(ge=0, le=3)]  # the work grows with the cube
FrameCount = Annotated[int, msgspec.Meta(ge=0, le=10_000)]
SlopeSize = Annotated[int, msgspec.Meta(ge=3, le=10_000)]  # fewer leave a slope without a spread


class TrackerConfig(Section, frozen=True):
    iou: Fraction = 0.25  # G2
    hold_s: Positive = 3.0  # G3
    confirm_hits: Size = 2  # G4
    danger_bottom: Fraction = 0.65  # G5
    danger_area: Fraction = 0.02  # G5
    box_retain: Fraction = 0.35  # G6
    confidence_retain: Fraction = 0.65  # G7
    max_tracks: Size = 64  # bounds the time that a step takes
    growth_full_scale_per_s: Positive = 0.16  # H1
    centering_full_scale_per_s: Positive = 0.20  # H2
    urgency_decay_s: Positive = 1.0  # H4
    held_decay_s: Positive = 1.0  # how fast the obstacle weight of a box fades while it is not seen


class MotionConfig(Section, frozen=True):
    """Apparent motion. The paper's constants are those of the `paper` profile where they differ.

    Measured: what `python -m paani_sim.studies.motion_table` showed best among the values tried.
    """

    history_s: Positive = 3.0  # measured; I5: 1.5
    max_samples: Size = 24  # I5
    min_samples: SlopeSize = 5  # I6
    min_duration_s: Positive = 0.7  # measured; I6: 0.4
    max_gap_s: Positive = 0.75  # I16
    follow_rate: bool = True  # window and gap reach over at least so many periods between frames
    history_periods: Positive = 6.0  # five samples and one missed frame
    gap_periods: Positive = 2.5  # one missed frame, and half a period of jitter
    compensate_rotation: bool = True  # of the boat, in apparent motion; I19: no
    max_odometry_gap_s: NonNegative = 0.3  # between a picture and the odometry nearest to it: its freshness limit
    deadband_per_s: Positive = 0.04  # I3
    margin_floor_per_s: Positive = 0.01  # I2
    margin_factor: Positive = 3.0  # I2
    min_quality: Fraction = 0.25  # I8
    max_confidence: Fraction = 0.9  # I9
    full_duration_s: Positive = 1.0  # of samples, for full confidence; the paper gives none
    full_samples: Size = 8  # for full confidence; the paper gives none
    full_detection_confidence: Positive = 0.6  # of the weakest sample, for full confidence; the paper gives none
    min_detection_confidence: Fraction = 0.40  # C6
    edge_margin: Fraction = 0.01  # of the picture; measured: three times the jitter of a box edge
    max_aspect_change: Positive = 0.4  # of log(width / height); measured: four times the jitter of a 16 px box
    shape_change_hits: Size = 2  # sightings of another shape before it is believed; I13: the first


class RiskConfig(Section, frozen=True):
    """`near_m`, `far_m`: with a valid calibration an obstacle counts fully up to one, not at all beyond the other.

    20 m are half a minute at cruise and more than the advisory's lifetime by a factor of nine; `far_m` 0: everything
    counts, as in the paper.
    """

    non_water: NonNegative = 0.55  # J4
    obstacle: NonNegative = 0.65  # J4
    urgency: NonNegative = 0.20  # J4
    uncertainty: NonNegative = 0.15  # J4
    near_m: NonNegative = 10.0
    far_m: NonNegative = 20.0

    def __post_init__(self) -> None:
        """What is far is farther than what is near."""
        if self.far_m and self.far_m <= self.near_m:
            raise ValueError("far_m: must be larger than near_m, or 0")


class PolicyConfig(Section, frozen=True):
    center_block_risk: Fraction = 0.48  # J5
    side_block_risk: Fraction = 0.58  # J5
    planned_side_block_risk: Fraction = 0.75  # J5 where the metric planner acts: hulls along a side leave a way between
    occupancy_bottom: Fraction = 0.65  # J6
    occupancy_coverage: Fraction = 0.25  # J6
    planned_coverage: Fraction = 0.5  # J6 where the metric planner acts: half of the lane is left to look for a way in
    occupancy_frames: Size = 2  # J6
    open_width: Fraction = 0.20  # of a lane; J5: none. A lane that shows a narrower way of connected water is blocked
    not_water: Fraction = 0.80  # a lane of which more is not surely water is no way, where the mask tells open water
    dry: Fraction = 0.95  # a lane of which more is no water is blocked, as water alone is a risk of 0.7 at most
    center_vessel_area: Fraction = 0.04  # J7
    center_vessel_height: Fraction = 0.10  # without a calibration, which tells no range; 0: by area alone (J7)
    core_left: Fraction = 0.405  # J9
    core_right: Fraction = 0.595  # J9
    tie: Fraction = 0.02  # two sides that differ by less are equally good
    side_change_margin: Fraction = 0.15  # measured: 95 % of what the sides' difference changes by between frames
    release_margin: Fraction = 0.08  # measured: 90 % of what the centre's risk changes by between frames
    clear_frames: Size = 2  # J10
    look_frames: FrameCount = 40  # 8 s at 5 Hz with no way free; then the boat turns where it is. 0: never (J5)


class PeopleConfig(Section, frozen=True):
    """What is done about people; `use=false` weighs them as anything else, as the paper does.

    `ahead_m`, `slow_m`, `stop_m`: distances within which a person blocks the way ahead, limits the speed, and stops the
    boat; they need a calibration. Without one everybody counts as near, a box of `stop_height` stops the boat, and no
    advice is to be followed faster than `uncalibrated_mps`, whoever is seen; nor is it by the open weights.
    """

    use: bool = True  # J1: a person is a box
    ahead_m: Positive = 20.0  # half a minute at cruise
    slow_m: Positive = 10.0
    stop_m: Positive = 1.5
    slow_mps: Positive = 0.3  # half of cruise: the boat stops within 0.4 m
    uncalibrated_mps: Positive = 0.3  # as near people: how far off anything is, nobody knows
    stop_height: Fraction = 0.6  # of the picture
    swim_mps: Positive = 1.75  # nobody swims faster for long: the record over 1,500 m is 1.73 m/s
    drift_frac: Fraction = 0.05  # of the picture, beside the centre: who is there may drift into the way
    widest_m: Positive = 3.0  # somebody on a board, or two together: what is calibrated and wider is no person
    recognised_confidence: Fraction = 0.60  # of a confirmed obstacle, which is then no person to a calibrated camera


class TuningConfig(Section, frozen=True):
    """When proposed parameters may be promoted, and how old a request may be."""

    min_frames: Size = 50  # 10 s at the nominal rate
    max_proposal_age_s: Positive = 3600.0  # what was proposed longer ago is no longer meant
    max_request_age_s: Positive = 5.0  # a request that lay longer is refused, not obeyed late


class AdvisorConfig(Section, frozen=True):
    rate_hz: Positive = 5.0  # J17
    evidence_max_age_s: Positive = 0.6  # J16 has 0.8: a silent camera stops the boat within a frame and 0.5 s
    lifetime_s: Positive = 3.5  # J16
    max_future_s: NonNegative = 0.1  # clocks on one machine agree to less
    fallback_non_water: Fraction = 1.0  # F3
    fallback_uncertainty: Fraction = 1.0  # F3: a mask drawn by rule is taken as unsure throughout
    counterfactual_size: RemovalSize = 3  # sets of up to so many pieces of evidence are sought; 0: none
    tracker: TrackerConfig = TrackerConfig()
    motion: MotionConfig = MotionConfig()
    risk: RiskConfig = RiskConfig()
    policy: PolicyConfig = PolicyConfig()
    people: PeopleConfig = PeopleConfig()
    tuning: TuningConfig = TuningConfig()
