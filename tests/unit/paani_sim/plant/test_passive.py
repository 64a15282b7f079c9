"""MuJoCo's process-wide force hook, shared safely."""

from collections.abc import Iterator

import mujoco
import pytest

from paani_sim.plant import passive

XML = """
<mujoco>
  <option gravity="0 0 0"/>
  <worldbody><body><freejoint/><geom size="0.1" mass="2"/></body></worldbody>
</mujoco>
"""


@pytest.fixture(autouse=True)
def clean_hook(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """No force of another test's plant, which lies open where that test failed."""
    monkeypatch.setattr(passive, "_forces", [])
    mujoco.set_mjcb_passive(None)
    yield
    mujoco.set_mjcb_passive(None)


def push(data: mujoco.MjData) -> None:
    data.qfrc_passive[0] = 4.0


def test_force_reaches_its_own_model_only() -> None:
    pushed, free = mujoco.MjModel.from_xml_string(XML), mujoco.MjModel.from_xml_string(XML)
    passive.install(pushed, push)
    states = [mujoco.MjData(pushed), mujoco.MjData(free)]
    for model, data in zip((pushed, free), states, strict=True):
        mujoco.mj_step(model, data)
    passive.uninstall(pushed)
    assert states[0].qacc[0] == pytest.approx(2.0)
    assert states[1].qacc[0] == 0.0


def test_models_compile_only_inside_compiling() -> None:
    model = mujoco.MjModel.from_xml_string(XML)
    passive.install(model, push)
    with passive.compiling():
        mujoco.MjModel.from_xml_string(XML)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    passive.uninstall(model)
    assert data.qacc[0] == pytest.approx(2.0)


def test_uninstalling_the_last_force_removes_the_hook() -> None:
    model = mujoco.MjModel.from_xml_string(XML)
    passive.install(model, push)
    passive.uninstall(model)
    assert mujoco.get_mjcb_passive() is None
