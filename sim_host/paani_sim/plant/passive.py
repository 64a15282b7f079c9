"""MuJoCo's passive-force callback, shared by every model of the process.

The hook is global: it is called for each model that steps, and no model compiles while a Python
function is installed. So forces are found by the identity of their model, and compiling happens
inside `compiling()`.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import mujoco

Force = Callable[[mujoco.MjData], None]

_forces: list[tuple[mujoco.MjModel, Force]] = []


def install(model: mujoco.MjModel, force: Force) -> None:
    """Call `force(data)` whenever MuJoCo wants the passive forces of `model`."""
    _forces.append((model, force))
    mujoco.set_mjcb_passive(_dispatch)


def uninstall(model: mujoco.MjModel) -> None:
    """Forget the forces of `model`; the hook itself goes with the last one."""
    _forces[:] = [(owner, force) for owner, force in _forces if owner is not model]
    if not _forces:
        mujoco.set_mjcb_passive(None)


@contextmanager
def compiling() -> Iterator[None]:
    """Models may be compiled inside."""
    mujoco.set_mjcb_passive(None)
    try:
        yield
    finally:
        if _forces:
            mujoco.set_mjcb_passive(_dispatch)


def _dispatch(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    for owner, force in _forces:
        if owner is model:
            force(data)
            return
