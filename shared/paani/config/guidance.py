"""Localization, navigator and controller settings.

Ids such as `J7` name statements of the paper (`paani claims`).
"""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec

from paani.config.planner import Angle, PlannerConfig
from paani.config.section import Fraction, NonNegative, Positive, Section
from paani.geometry import MAX_ORIGIN_LATITUDE_DEG

TotalTurn = Annotated[float, msgspec.Meta(gt=0.0, le=170.0)]  # degrees; half a turn could not be told from none
OriginLatitude = Annotated[float, msgspec.Meta(ge=-MAX_ORIGIN_LATITUDE_DEG, le=MAX_ORIGIN_LATITUDE_DEG)]
Longitude = Annotated[float, msgspec.Meta(ge=-180.0, le=180.0)]


class LocalizationConfig(Section, frozen=True):
    """The two filters for pose and velocity, and when they are healthy.

    `origin_lat_lon_deg`: where the origin of the map lies; unset, it is the first fix.
    """

    rate_hz: Positive = 20.0  # L1, L3: estimates at so many steps a second
    # `augmented` estimates the slow errors of receiver and compass and the drift too; `plain` is L3.
    ekf: Literal["augmented", "plain"] = "augmented"
    origin_lat_lon_deg: tuple[OriginLatitude, Longitude] | None = None
    gate_mahalanobis2: Positive = 25.0  # validation gate of a fix: 5 standard deviations
    gps_wander_s: Positive = 60.0  # time constant of the receiver's slow error; as `plant.sensors.gps_bias_time_s`
    calibration_s: NonNegative = 1.0  # at rest, over which the biases of the gyroscope are first averaged
    max_gps_age_s: Positive = 3.0  # 15 fixes at the nominal rate; later the estimate is unhealthy
    max_imu_age_s: Positive = 0.3  # 30 samples at the nominal rate; later the estimate is unhealthy
    max_position_std_m: Positive = 8.0  # less sure of where it is, the estimate is unhealthy
    max_yaw_std_rad: Positive = 0.35  # 20 degrees; less sure of its heading, the estimate is unhealthy
    stopped_speed_mps: NonNegative = 0.05  # L5: a boat slower than this
    stopped_after_s: Positive = 2.0  # L5: for so long is stopped


class NavigatorConfig(Section, frozen=True):
    """Guidance along a mission, and the ages of inputs beyond which the boat may not move.

    `route`, `mission`, `fence` and `land` are paths of files; the formats are in the navigator's README. With neither
    `route` nor `mission` the boat does not move. Without `mission` the `route` alone is followed.
    """

    route: str = ""
    mission: str = ""
    fence: str = ""
    land: str = ""  # kept out of as an area of the fence, and by no client taken away
    rate_hz: Positive = 10.0  # orders a second at least; changes of advice or inhibits go out at once
    acceptance_m: Positive = 1.5  # a waypoint counts as reached within it; M2: 1.0
    pass_abeam_m: NonNegative = 6.0  # a waypoint left behind within this distance counts; 0: never
    lookahead_m: NonNegative = 4.0  # line of sight along the leg; 0: plain waypoint bearing (M4)
    # Gain of the integral against wind and current, sigma of Borhaug, Pavlov and Pettersen, CDC 2008; 0: none.
    # The approach to the line has a damping ratio of half the root of cruise over gain: 0.77.
    crab_gain_mps: NonNegative = 0.25
    max_crab_deg: Annotated[float, msgspec.Meta(ge=0.0, le=60.0)] = 40.0  # holds against a drift of 0.64 of the speed
    station_speed_frac: Fraction = 0.5  # of cruise, on the way back to a station
    station_inner_frac: Fraction = 0.5  # of the station's radius: a boat that left the radius comes back this far in
    fence_margin_m: NonNegative = 1.5  # kept to the fence beyond the way to stop; the GPS error is 0.8 m per axis
    fence_stop_s: Positive = 5.0  # way to stop over speed; measured: 3.6 s for otter from 0.6 m/s, adrift in wind
    fence_return: bool = False  # outside the fence, obey orders that lead straight back in
    cruise_mps: Positive = 0.6  # M7: 0.15; at 0.6 the boat stops within 0.9 m
    # Times the course's speed, out of the way of what comes to the boat: `controller.max_speed_mps` at cruise. Of 120
    # vessels known 6 s before, with a velocity measured within 0.25 m/s, 23 strike with 1 and 12 with 1.5.
    escape_factor: Annotated[float, msgspec.Meta(ge=1.0, le=3.0)] = 1.5
    turn_speed_frac: Fraction = 0.5  # M7: of cruise, during advised turns
    turn_deg: Positive = 25.0  # M5: off the present heading, for LEFT and RIGHT
    slight_turn_deg: Positive = 10.0  # M6: the same for SLIGHT_LEFT and SLIGHT_RIGHT
    latch_turns: bool = True  # an advised turn is held until it is made; M5: no
    turn_hold_s: NonNegative = 1.5  # on a latched heading before the next turn is added
    max_total_turn_deg: TotalTurn = 90.0  # of one run of advised turns, so that a stuck detection cannot spin the boat
    # Without the planner: way made past what was last seen beside the bow, before the boat turns back; 0: none.
    clear_m: NonNegative = 6.0
    advisory_max_age_s: Positive = 3.5  # M10: since the picture was taken
    advisory_max_receipt_s: Positive = 0.6  # M10: since the advisory was received
    odometry_max_age_s: Positive = 0.4  # eight periods of `localization.rate_hz`
    clock_max_age_s: Positive = 0.4  # eight periods of the plant's clock
    arming_max_age_s: Positive = 1.0  # five periods of the operator's arming message
    order_max_age_s: Positive = 1.0  # of the mode ordered, ten periods of it; then no thrust
    stick_max_age_s: Positive = 0.4  # of what a hand says in MANUAL; then no thrust
    # Where the advice or the lack of a path stops it and nobody is near, thrust holds the boat; the planner's alone.
    keep_station: bool = True
    hold_radius_m: Positive = 4.0  # of the station of HOLD and RETURN, on which there is no thrust
    manual_turn_deg: Positive = 28.0  # off the bow at full stick: of the controller's gain, its most steering
    max_future_s: NonNegative = 0.1  # clocks on one machine agree to less
    planner: PlannerConfig = PlannerConfig()


class ControllerConfig(Section, frozen=True):
    """From an order to the thrust of two fans.

    `astern`: the most that a fan pushes astern, to brake and to turn on the spot; 0: never.
    `turn_on_deg`: to a heading further off the bow a boat that turns turns on, though the other way may be shorter;
    180: always the shorter way.
    """

    rate_hz: Positive = 10.0  # N1: each order is answered at once; without one, a little less often than this
    max_speed_mps: Positive = 0.9  # orders beyond it are cut; N2: 0.30
    speed_kp: NonNegative = 0.15  # thrust per m/s of error; N3: 0.08
    speed_ki: NonNegative = 0.05  # thrust per metre of summed error: removes what wind and current leave; N3: none
    speed_feed_forward: NonNegative = 0.0  # N3; used when `drag_feed_forward` is off
    drag_feed_forward: bool = True  # thrust from the hull's drag at the ordered speed; N3: in proportion to it
    drag_linear: NonNegative = 4.0  # K5: newtons per m/s of the hull
    drag_quadratic: NonNegative = 20.0  # K5: newtons per (m/s)^2 of the hull
    force_per_unit_n: Positive = 75.0  # O1: of one fan at full thrust
    heading_kp: NonNegative = 0.20  # thrust per radian of error; N4: 0.08
    heading_kd: NonNegative = 0.14  # thrust per rad/s of turning; damps the turn; N4: 0.05
    max_forward: Fraction = 0.15  # of a fan's force: enough for `max_speed_mps`, with some left; N5: 0.08
    max_steer: Fraction = 0.10  # of a fan's force, to each side; N5: 0.04
    astern: Fraction = 0.10  # `max_steer`, so that a turn on the spot is a pure couple
    turn_on_deg: Angle = 150.0  # there the shorter way saves 3 s of 10, and less further astern; N4: the shorter way
    max_integral: Fraction = 0.03  # what the integral may add at most: a fifth of `max_forward`
    slew_per_s: Positive = 0.5  # full thrust in two seconds; a stop is not limited; N6: 0.15
    command_max_receipt_s: Positive = 0.35  # three periods and a half of `navigator.rate_hz`; then zero thrust
    odometry_max_age_s: Positive = 0.4  # eight periods of `localization.rate_hz`
