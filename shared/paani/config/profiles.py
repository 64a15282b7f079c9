"""The profiles: each difference from the default is one value here."""

from __future__ import annotations

from paani.keys import VITAL_SERVICES, Graph, services_in

PAPER: dict[str, object] = {
    "profile": "paper",
    "world": {"name": "bare_lake"},  # K1, K3
    "camera": {"rate_hz": 0.5},  # A8: newest frame once every 2 s
    "perception": {
        "rate_hz": 0.5,  # J17
        "concurrent": False,  # B4
        "intra_op_threads": 2,  # C14, D11
        "corridors": {"open_water": False},  # J5: risk alone
        "candidates": {"use": False},  # C6: what is below the threshold is nothing
        "follow_roll": False,  # E3: corridors are fixed in the picture
        "image_quality": {"enabled": False},  # J19
    },
    "advisor": {
        "fallback_non_water": 0.5,  # F3, F4
        "fallback_uncertainty": 0.5,
        "evidence_max_age_s": 3.5,  # J16, M10: the advisory outlives its frame at 0.5 Hz
        "motion": {
            "follow_rate": False,  # I22
            "history_s": 1.5,  # I5
            "min_duration_s": 0.4,  # I6
            "shape_change_hits": 1,  # I13
            "compensate_rotation": False,  # I19
        },
        "people": {"use": False},  # J1
        "risk": {"far_m": 0.0},  # J1: by the picture alone
        "tracker": {"held_decay_s": 1e9},  # G3: a held box weighs as much as a seen one
        "policy": {
            "center_vessel_height": 0.0,  # J7: by area alone
            "side_change_margin": 0.0,  # J5: thresholds without memory
            "release_margin": 0.0,
            "open_width": 0.0,
            "dry": 1.0,  # J5: risk alone
            "look_frames": 0,  # J5: no side, no motion
        },
    },
    "localization": {"ekf": "plain"},  # L3
    "navigator": {
        "acceptance_m": 1.0,  # M2
        "pass_abeam_m": 0.0,  # M2
        "lookahead_m": 0.0,  # M4
        "crab_gain_mps": 0.0,  # M4
        "cruise_mps": 0.15,  # M7
        "clear_m": 0.0,
        "keep_station": False,
        "latch_turns": False,  # M5: continuous
        "planner": {  # Q: a prototype beside the evaluated configuration
            "use": False,
            "hidden_s": 0.0,  # Q3
            "barred_s": 0.0,
            "outvoted_by": 0,  # Q3
            "margin_m": 0.25,  # Q6
            "person_room_m": 0.0,  # Q6
            "speed_mps": 0.4,  # Q5
            "accel_mps2": 0.2,  # Q5
            "room_m": 0.0,  # Q4
            "look_m": 0.0,  # Q4
        },
    },
    "controller": {
        "max_speed_mps": 0.30,  # N2
        "speed_kp": 0.08,  # N3
        "speed_ki": 0.0,
        "speed_feed_forward": 0.16,  # N3
        "drag_feed_forward": False,
        "heading_kp": 0.08,  # N4
        "heading_kd": 0.05,  # N4
        "turn_on_deg": 180.0,  # N4
        "max_forward": 0.08,  # N5
        "max_steer": 0.04,  # N5
        "slew_per_s": 0.15,  # N6
        "astern": 0.0,  # N7
    },
    "plant": {"adapter": {"astern": 0.0}},
    "bridge": {"lease_ms": 3600},  # J16, M10: advice is shown as long as it may be followed
}

# A wide lens, level: who comes from 50 degrees off the bow is in the picture. What is meant by an angle, in the default
# for 70 degrees, 4:3 and 6 degrees down, stands where that angle lies in the picture; but the side corridors go on to
# its sides, as a boat before a quay turns to water that a narrow lens does not see.
WIDE: dict[str, object] = {
    "profile": "wide",
    "eye": {"hfov_deg": 102.0, "height_px": 180, "pitch_down_deg": 0.0},  # as a Raspberry Pi Camera Module 3 Wide, 16:9
    "perception": {
        "corridors": {"top": 0.42, "left": (0.02, 0.4375), "center": (0.392, 0.608), "right": (0.5625, 0.98)}
    },
    "advisor": {"policy": {"core_left": 0.446, "core_right": 0.554, "occupancy_bottom": 0.69}},
}

# Fans, or controllers of motors, that only push ahead: the boat turns by driving, and stops by drag alone.
FANS: dict[str, object] = {
    "profile": "fans",
    "navigator": {
        "planner": {
            "turn_radius_m": 2.2,  # measured: K5 drag, at any speed
            "helm_speed_mps": 0.5,  # measured: what one fan alone drives a boat at that turns as hard as it can
            "room_m": 3.0,  # turn_radius_m, hull_radius_m and margin_m
            "brake_s": 0.0,
        }
    },
    "controller": {"astern": 0.0},
    "plant": {"adapter": {"astern": 0.0}},
}

# Hardware in the loop: thrust goes to an emulated microcontroller, and the simulated boat moves by its PWM alone.
HIL: dict[str, object] = {"profile": "hil", "bus": {"graph": "hil"}}

# A real boat: thrust goes to the microcontroller, fixes come from its sensors, and there is no simulator.
HULL: dict[str, object] = {
    "profile": "hull",
    "bus": {"graph": "hull"},
    "camera": {"source": "webcam"},
    "plant": {"adapter": {"require_pulses": [name for name in VITAL_SERVICES if name in services_in(Graph.HULL)]}},
}

PROFILES: dict[str, dict[str, object]] = {
    "paani": {},
    "wide": WIDE,
    "fans": FANS,
    "paper": PAPER,
    "hil": HIL,
    "hull": HULL,
}
