"""Settings: layered, closed, and refused with one line that names the field."""

from __future__ import annotations

import codecs
import math
from collections.abc import Iterator
from pathlib import Path

import pytest
from msgspec import inspect as types

from paani import messages as m
from paani.config import Config, EyeConfig, decode_config, encode_config, load_config, with_settings
from paani.errors import UserError


def test_later_layers_win(tmp_path: Path) -> None:
    file = tmp_path / "boat.toml"
    file.write_text("[camera]\nrate_hz = 3.0\nsource = 'webcam'\n[navigator]\ncruise_mps = 0.4\n")
    config = load_config(
        file=file, environ={"PAANI_CAMERA__RATE_HZ": "4.0", "HOME": "/"}, sets=["navigator.cruise_mps=0.5"]
    )
    assert (config.camera.source, config.camera.rate_hz, config.navigator.cruise_mps) == ("webcam", 4.0, 0.5)


@pytest.mark.parametrize(
    ("setting", "line"),
    [
        ("advisor.policy.centre=1", "advisor.policy: Object contains unknown field `centre`"),
        ("advisor.policy.center_blok_risk=1", "(did you mean advisor.policy.center_block_risk?)"),
        ("advisr.lifetime_s=1", "Object contains unknown field `advisr` (did you mean advisor?)"),
        ("boat.name=x", "Object contains unknown field `boat` (have: profile, bus, camera, "),
        ("camera.rate_hz=0", "camera.rate_hz: Expected `float` > 0.0"),
        ("camera.rate_hz=nan", "camera.rate_hz: Expected `float` > 0.0"),
        ("eye.camera_forward_m=inf", "eye.camera_forward_m: Expected `float` <= 50.0"),
        ("camera.rate_hz=fast", "camera.rate_hz: Expected `float`, got `str`"),
        ("bus.vessel=Otter/x", "bus.vessel: Expected `str` matching regex"),
        ("navigator.cruise_mps=2.0", "navigator.cruise_mps 2.0 exceeds controller.max_speed_mps 0.9"),
        ("profile=fancy", "profile: unknown profile 'fancy'"),
        ("nonsense", "expected section.field=value"),
        ("advisor.lifetime_s=0.1", "advisor.evidence_max_age_s exceeds advisor.lifetime_s"),
        ("navigator.max_total_turn_deg=180", "navigator.max_total_turn_deg: Expected `float` <= 170.0"),
        ("navigator.planner.step_s=6", "navigator.planner.step_s 6.0 steps over what is as wide as the hull"),
        ("navigator.planner.horizon_s=0.3", "navigator.planner.horizon_s 0.3 is less than two steps"),
        ("bus.router=foo", "bus: router foo: expected tcp/HOST:PORT"),
        ("bus.link=tcp/127.0.0.1:99999", "bus: link tcp/127.0.0.1:99999: expected tcp/HOST:PORT"),
        ("bus.shore=udp/127.0.0.1:7447", "bus: shore udp/127.0.0.1:7447: expected tcp/HOST:PORT"),
        ('bus.runtime_dir="a\\u0000b"', "bus.runtime_dir: holds a NUL character"),
        ("navigator.route=a\udcff.toml", "navigator.route: holds a NUL character, or bytes that are not UTF-8"),
        ('profile=["paper"]', "profile: unknown profile '['paper']'"),
        ('"a` - at `$.zzz"=1', "Object contains unknown field"),
    ],
)
def test_a_bad_setting_is_one_line_that_names_it(setting: str, line: str) -> None:
    with pytest.raises(UserError) as error:
        load_config(sets=[setting])
    assert line in str(error.value)
    assert "\n" not in str(error.value)


def test_settings_under_an_earlier_name_still_load(tmp_path: Path) -> None:
    """In a file, the environment, a `--set` and the configuration inside a recording; the present name wins."""
    file = tmp_path / "boat.toml"
    file.write_text("[perception.gate]\nskew = 0.5\n")
    loaded = load_config(
        file=file, environ={"PAANI_PERCEPTION__GATE__BLUR_FINENESS": "0.3"}, sets=["perception.gate.enabled=false"]
    ).perception.image_quality
    assert (loaded.skew, loaded.blur_fineness, loaded.enabled) == (0.5, 0.3, False)
    assert with_settings(Config(), ["perception.gate.skew=0.4"]).perception.image_quality.skew == 0.4
    recorded = encode_config(load_config(sets=["perception.image_quality.skew=0.6"]))
    assert decode_config(recorded.replace(b'"image_quality":', b'"gate":')).perception.image_quality.skew == 0.6
    file.write_text("[perception.gate]\nskew = 0.5\nenabled = false\n[perception.image_quality]\nskew = 0.7\n")
    both = load_config(file=file).perception.image_quality
    assert (both.skew, both.enabled) == (0.7, False)
    with pytest.raises(UserError, match=r"perception\.image_quality: Object contains unknown field `nothing`"):
        load_config(sets=["perception.gate.nothing=1"])


RECORDED_BEFORE = b"""{"profile": "paper", "camera": {"rate_hz": 0.5},
    "perception": {"rate_hz": 0.5, "fallback_non_water": 0.4, "fallback_uncertainty": 0.3, "gate": {"enabled": false}},
    "advisor": {"evidence_max_age_s": 3.5, "motion": {"follow_rate": false, "history_s": 1.5, "min_duration_s": 0.4}},
    "navigator": {"cruise_mps": 0.15, "planner": {"use": false}}, "controller": {"max_speed_mps": 0.3}}"""


def test_the_water_of_an_ineligible_mask_loads_from_its_earlier_section(tmp_path: Path) -> None:
    """It was a setting of perception, which never read it."""
    recorded = decode_config(RECORDED_BEFORE)
    assert (recorded.advisor.fallback_non_water, recorded.advisor.fallback_uncertainty) == (0.4, 0.3)
    assert not recorded.perception.image_quality.enabled
    assert not recorded.is_planner_active
    file = tmp_path / "boat.toml"
    file.write_text("[perception]\nfallback_non_water = 0.7\n")
    loaded = load_config(file=file, profile="paper", sets=["perception.fallback_uncertainty=0.2"])
    assert (loaded.advisor.fallback_non_water, loaded.advisor.fallback_uncertainty) == (0.7, 0.2)


def test_a_file_may_begin_with_a_byte_order_mark_and_end_its_lines_as_windows_does(tmp_path: Path) -> None:
    for name, data in (("a.toml", b"[camera]\r\nrate_hz = 5\r\n"), ("a.json", b'{"camera":\r\n{"rate_hz": 5}}')):
        file = tmp_path / name
        file.write_bytes(codecs.BOM_UTF8 + data)
        assert load_config(file=file).camera.rate_hz == 5.0


@pytest.mark.parametrize("content", ["[camera", "\x00", "camera = 3"])
def test_a_bad_file_is_named(tmp_path: Path, content: str) -> None:
    file = tmp_path / "boat.toml"
    file.write_text(content)
    with pytest.raises(UserError, match=r"boat\.toml"):
        load_config(file=file)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"absent\.toml"):
        load_config(file=tmp_path / "absent.toml")


@pytest.mark.parametrize(("rate_hz", "accepted"), [(0.5, False), (2.0, False), (3.0, True)])
def test_a_rate_that_starves_the_motion_estimator_is_refused_i22(rate_hz: float, accepted: bool) -> None:
    sets = [f"perception.rate_hz={rate_hz}", "advisor.motion.follow_rate=false", "advisor.motion.history_s=1.5"]
    if accepted:
        load_config(sets=sets)
    else:
        with pytest.raises(UserError, match=r"perception\.rate_hz"):
            load_config(sets=sets)


@pytest.mark.parametrize(
    ("sets", "field"),
    [
        (["controller.astern=0.2"], r"controller\.astern exceeds plant\.adapter\.astern"),
        (["controller.astern=0.0"], r"navigator\.planner\.turn_radius_m must be above 0"),
        (["controller.max_steer=0.2"], r"navigator\.planner\.turn_radius_m must be above 0"),
    ],
)
def test_a_planner_that_turns_on_the_spot_needs_a_boat_that_can(sets: list[str], field: str) -> None:
    """And the thrust adapter must let through what the controller orders."""
    with pytest.raises(UserError, match=field):
        load_config(sets=sets)


def test_fans_that_only_push_are_a_profile() -> None:
    fans = load_config(profile="fans")
    assert (fans.controller.astern, fans.plant.adapter.astern) == (0.0, 0.0)
    assert fans.navigator.planner.turn_radius_m > load_config().navigator.planner.turn_radius_m == 0.0


def aside_deg(eye: EyeConfig, x: float) -> float:
    """Bearing of a column of the picture."""
    return math.degrees(math.atan((x - 0.5) * 2.0 * math.tan(math.radians(0.5 * eye.hfov_deg))))


def down_deg(eye: EyeConfig, y: float) -> float:
    """Depression of a row of the picture, at its middle."""
    widths = (y - 0.5) * eye.height_px / eye.width_px
    return eye.pitch_down_deg + math.degrees(math.atan(widths * 2.0 * math.tan(math.radians(0.5 * eye.hfov_deg))))


def test_the_wide_profile_means_the_same_angles() -> None:
    plain, wide = load_config(), load_config(profile="wide")
    for narrow, other in zip(_columns(plain), _columns(wide), strict=True):
        assert aside_deg(wide.eye, other) == pytest.approx(aside_deg(plain.eye, narrow), abs=0.3)
    rows = [(c.perception.corridors.top, c.advisor.policy.occupancy_bottom) for c in (plain, wide)]
    for narrow, other in zip(*rows, strict=True):
        assert down_deg(wide.eye, other) == pytest.approx(down_deg(plain.eye, narrow), abs=0.6)
    assert down_deg(wide.eye, 1.0) == pytest.approx(down_deg(plain.eye, 1.0), abs=2.0)
    sides = wide.perception.corridors.left[0], wide.perception.corridors.right[1]
    assert sides == pytest.approx((0.02, 0.98))


def _columns(config: Config) -> list[float]:
    corridors, policy = config.perception.corridors, config.advisor.policy
    return [corridors.left[1], *corridors.center, corridors.right[0], policy.core_left, policy.core_right]


def test_a_configuration_survives_being_handed_to_a_child() -> None:
    config = load_config(profile="paper", sets=["camera.source=/tmp/pictures"])
    assert decode_config(encode_config(config)) == config
    with pytest.raises(UserError):
        decode_config(b'{"camera": {"rate": 1}}')


def numbers_of(info: types.Type, path: str = "") -> Iterator[tuple[str, types.IntType | types.FloatType]]:
    match info:
        case types.IntType() | types.FloatType():
            yield path, info
        case types.StructType():
            for field in info.fields:
                yield from numbers_of(field.type, f"{path}.{field.encode_name}".lstrip("."))
        case types.TupleType(item_types=parts) | types.UnionType(types=parts):
            for part in parts:
                yield from numbers_of(part, path)
        case types.VarTupleType():
            yield from numbers_of(info.item_type, path)


def test_every_number_has_both_bounds() -> None:
    """Infinity and what is no number have no JSON, so that a child could not be handed them."""
    numbers = dict(numbers_of(types.type_info(Config)))
    assert len(numbers) > 200
    open_ended = [path for path, of in numbers.items() if of.le is None or (of.ge is None and of.gt is None)]
    assert open_ended == []


def test_defaults_are_valid() -> None:
    assert load_config() == Config()


def test_what_settings_make_together_has_to_hold_whatever_their_order() -> None:
    faster = ["navigator.cruise_mps=1.9", "controller.max_speed_mps=2.0"]
    assert load_config(sets=faster) == load_config(sets=faster[::-1])
    with pytest.raises(UserError, match=r"^--set navigator\.cruise_mps=1\.9: navigator\.cruise_mps 1\.9 exceeds"):
        load_config(sets=["camera.rate_hz=4.0", faster[0], "eye.camera_forward_m=0.2"])


def test_a_configuration_keeps_the_profile_that_its_values_are_of() -> None:
    with pytest.raises(UserError, match=r"^--set profile=paper: a configuration's profile stays \(paani\)"):
        with_settings(Config(), ["profile=paper"])


def test_what_was_the_dashboards_is_the_starts() -> None:
    recorded = encode_config(Config()).replace(b'"dashboard":{', b'"dashboard":{"arm_at_start":true,')
    assert decode_config(recorded.replace(b'"up":{"arm_at_start":false,', b'"up":{')).up.arm_at_start


def test_a_planner_looks_as_far_as_the_boat_needs_to_stop() -> None:
    short = ["navigator.planner.horizon_s=1.0", "navigator.planner.look_m=0.8"]
    with pytest.raises(UserError, match=r"navigator\.planner looks 1\.4 m ahead .*: 1\.5 m \(stop_s, room_m\)"):
        load_config(sets=short)
    load_config(sets=[*short, "navigator.planner.use=false"])
    load_config(sets=[short[0], "navigator.planner.look_m=0.95"])


def test_b16_a_calibration_without_a_field_of_view_is_none() -> None:
    with pytest.raises(UserError, match="hfov_deg is not known"):
        load_config(sets=["calibration.valid=true", "calibration.height_m=1"])
    assert not m.PictureHeader(source_us=1, frame_seq=0, frame_epoch=0, width_px=4, height_px=3).calibrated
