"""Constants of the paper's tables beside those that its profile and its boat have, read out of them. Pure."""

from __future__ import annotations

from functools import reduce

# Statement, what it is, the paper's figures, and the settings that hold them.
RUNTIME: tuple[tuple[str, str, str, tuple[str, ...]], ...] = (
    ("C6", "detector confidence", "0.4", ("perception.detections.confidence",)),
    ("C7 C8 C9", "NMS input / IoU / boxes kept", "256 / 0.45 / 24", (
        "perception.detections.nms_input", "perception.detections.nms_iou", "perception.detections.max_boxes")),
    ("G2 G3 G4", "track IoU / hold [s] / hits", "0.25 / 3 / 2", (
        "advisor.tracker.iou", "advisor.tracker.hold_s", "advisor.tracker.confirm_hits")),
    ("G5", "immediate danger bottom / area", "0.65 / 0.02", (
        "advisor.tracker.danger_bottom", "advisor.tracker.danger_area")),
    ("I5", "motion history: samples / [s]", "24 / 1.5", ("advisor.motion.max_samples", "advisor.motion.history_s")),
    ("I6", "motion minimum: samples / [s]", "5 / 0.4", ("advisor.motion.min_samples", "advisor.motion.min_duration_s")),
    ("I16 I3", "motion gap [s] / deadband [1/s]", "0.75 / 0.04", (
        "advisor.motion.max_gap_s", "advisor.motion.deadband_per_s")),
    ("J4", "risk weights N / O / M / U", "0.55 / 0.65 / 0.2 / 0.15", (
        "advisor.risk.non_water", "advisor.risk.obstacle", "advisor.risk.urgency", "advisor.risk.uncertainty")),
    ("J5", "center / side threshold", "0.48 / 0.58", (
        "advisor.policy.center_block_risk", "advisor.policy.side_block_risk")),
    ("J16", "input freshness / advisory lifetime [s]", "0.8 / 3.5", (
        "perception.max_frame_age_s", "advisor.lifetime_s")),
    ("J17", "perception / advisor [Hz]", "0.5 / 5", ("perception.rate_hz", "advisor.rate_hz")),
    ("M7 N2", "cruise / speed cap [m/s]", "0.15 / 0.3", ("navigator.cruise_mps", "controller.max_speed_mps")),
    ("N5", "forward / steering cap", "0.08 / 0.04", ("controller.max_forward", "controller.max_steer")),
    ("N1 N6", "controller [Hz] / slew [1/s]", "10 / 0.15", ("controller.rate_hz", "controller.slew_per_s")),
    ("O1 O2", "fan [N per unit] / watchdog [s]", "75 / 0.5", (
        "plant.adapter.force_per_unit_n", "plant.adapter.timeout_s")),
    ("Q3", "free / occupied lifetime [s]", "0.8 / 2", ("navigator.planner.free_s", "navigator.planner.occupied_s")),
    ("Q4", "footprint horizon / step [s]", "3 / 0.2", ("navigator.planner.horizon_s", "navigator.planner.step_s")),
    ("Q5", "prototype [m/s] / [rad/s] / [m/s2]", "0.4 / 0.35 / 0.2", (
        "navigator.planner.speed_mps", "navigator.planner.yaw_rate_radps", "navigator.planner.accel_mps2")),
    ("Q6", "hull radius / margin [m] / drift [m/s]", "0.55 / 0.25 / 0.15", (
        "navigator.planner.hull_radius_m", "navigator.planner.margin_m", "navigator.planner.drift_mps")),
)  # fmt: skip
BOAT: tuple[tuple[str, str, str, tuple[str, ...]], ...] = (
    ("K4 K6", "mass [kg] / equilibrium height [m]", "12.4 / 0.177", ("hull.mass_kg", "buoyancy.equilibrium_z_m")),
    ("K6", "heave stiffness / damping", "650 / 90", ("buoyancy.heave_stiffness", "buoyancy.heave_damping")),
    ("K7", "roll and pitch restoring / damping", "90 / 24 / 90 / 24", (
        "buoyancy.roll_stiffness", "buoyancy.roll_damping", "buoyancy.pitch_stiffness", "buoyancy.pitch_damping")),
    ("K5", "surge drag", "4 / 20", ("drag.surge_linear", "drag.surge_quadratic")),
    ("K5", "sway drag", "20 / 80", ("drag.sway_linear", "drag.sway_quadratic")),
    ("K5", "yaw drag", "4 / 25", ("drag.yaw_linear", "drag.yaw_quadratic")),
)  # fmt: skip


def figures_at(tree: object, names: tuple[str, ...]) -> str:
    """What the tree holds under these dotted names, numbers all, as the paper's tables have it."""
    return " / ".join(f"{reduce(getattr, name.split('.'), tree):g}" for name in names)
