"""Lines of devices in the settings."""

from __future__ import annotations

import pytest

from paani.config import load_config
from paani.config.sensors import recording_of
from paani.errors import UserError


@pytest.mark.parametrize(
    "line",
    ["", "serial:/dev/ttyUSB0@9600", "socket://127.0.0.1:2947", "file:a.nmea", "file:a?speed=4", "file:a?speed=max"],
)
def test_a_line_that_can_be_opened_is_taken(line: str) -> None:
    assert load_config(sets=(f'sensors.gps.line="{line}"',)).sensors.gps.line == line


@pytest.mark.parametrize(
    "line", ["/dev/ttyUSB0", "serial:ttyUSB0", "serial:/dev/a@5", "file:", "file:a?speed=0.5", "file:a?speed=x"]
)
@pytest.mark.parametrize("device", ["gps", "imu", "heading"])
def test_another_is_refused_with_its_field(device: str, line: str) -> None:
    with pytest.raises(UserError, match=rf"sensors.*{device}\.line") as refusal:
        load_config(sets=(f'sensors.{device}.line="{line}"',))
    assert "\n" not in str(refusal.value)


def test_the_speed_of_a_recording() -> None:
    assert recording_of("file:/a/b.nmea") == ("/a/b.nmea", 1.0)
    assert recording_of("file:/a/b.nmea?speed=2.5") == ("/a/b.nmea", 2.5)
    assert recording_of("file:/a/b.nmea?speed=max") == ("/a/b.nmea", None)


@pytest.mark.parametrize("device", ["gps", "imu", "heading"])
@pytest.mark.parametrize("user", ["bridge", "thrusters", "thrusters.autopilot"])
def test_a_line_to_the_microcontroller_is_no_sensors_line(device: str, user: str) -> None:
    lines = (f"sensors.{device}.line=serial:/dev/ttyACM0@9600", f"{user}.line=serial:/dev/ttyACM0")
    with pytest.raises(UserError, match=rf"sensors\.{device}\.line .* {user}\.line"):
        load_config(profile="hull", sets=lines)
    load_config(profile="hull", sets=(lines[0], f"{user}.line=serial:/dev/ttyACM1"))


@pytest.mark.parametrize("device", ["gps", "imu", "heading"])
def test_a_recording_guides_no_boat_that_moves(device: str) -> None:
    recording, line = f"sensors.{device}.line=file:drive.nmea", "thrusters.line=serial:/dev/ttyACM0"
    for way in (line, "thrusters.autopilot.line=serial:/dev/ttyACM0", "thrusters.autopilot.line=socket://127.0.0.1:5"):
        with pytest.raises(UserError, match=rf"sensors\.{device}\.line file:drive\.nmea: a recording"):
            load_config(profile="hull", sets=(recording, way))
    load_config(profile="hull", sets=(recording,))
    load_config(profile="hull", sets=(recording, "thrusters.line=serial:/dev/pts/7"))  # an emulator moves nothing


@pytest.mark.parametrize("source", ["trip.mp4", "pictures", "webcam.mp4"])
def test_a_film_guides_no_boat_that_moves(source: str) -> None:
    film = f"camera.source={source}"
    for way in ("thrusters.line=serial:/dev/ttyACM0", "thrusters.autopilot.line=socket://127.0.0.1:5"):
        with pytest.raises(UserError, match=rf"camera\.source {source}: a recording .*{way.partition('=')[0]} is set"):
            load_config(profile="hull", sets=(film, way))
        for camera in ("webcam", "webcam:1"):
            load_config(profile="hull", sets=(f"camera.source={camera}", way))
    load_config(profile="hull", sets=(film,))
    load_config(profile="hull", sets=(film, "thrusters.line=serial:/dev/pts/7"))  # an emulator moves nothing
