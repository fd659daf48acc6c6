from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from headless_chromium import axe, browser  # noqa: F401 - fixtures
from maniport import spd
from sizes import motion_alone


@pytest.fixture(scope="session")
def motion():
    """Make times with a pause in the recording, and a smooth profile of d×d ellipsoids."""

    def make(d=3, count=60):
        time = np.linspace(0.0, 4.0, count)
        time[count // 2 :] += 1.5
        swing = (
            np.sin(np.linspace(0, 3, count))[:, None, None] * np.arange(d * d).reshape(d, d) / d**2
        )
        shear = np.cos(np.linspace(0, 2, count))[:, None, None] * np.eye(d)[::-1]
        tangents = 0.5 * (swing + np.swapaxes(swing, 1, 2)) + 0.4 * shear
        return time, spd.expm(tangents + np.diag(np.linspace(-2.0, -0.5, d)))

    return make


@pytest.fixture(scope="session")
def result(small_result):
    return small_result


@pytest.fixture(scope="session")
def alone(small_result):
    return motion_alone(small_result)


@pytest.fixture(scope="session")
def changed():
    """Return a result with changes of its arm, and of the motion of the arm."""

    def change(result, arm=None, **motion):
        own = replace(result.arm, **(arm or {}))
        own = replace(own, motion=replace(own.motion, **motion)) if motion else own
        return replace(
            result,
            arms=(own,),
            motion=replace(result.motion, arms=(own.motion,), trajectory=own.motion),
        )

    return change


@pytest.fixture(scope="session")
def several(result):
    """Make a transfer to several arms that share no joints, of copies of one arm."""

    def make(count):
        names = ("left", "right", "middle")[:count]
        motion = result.motion
        arm = result.arm
        joints = [f"{name}_{joint}" for name in names for joint in arm.motion.joint_names]
        columns = np.split(np.arange(len(joints)), count)
        robot = SimpleNamespace(name="robot", joint_names=joints, shared=(), columns=columns)
        error = np.full((len(arm.motion.time), count - 1), 1e-3)
        whole = (
            replace(motion, arms=count * motion.arms, relative_error=error) if count > 1 else motion
        )
        return replace(
            result, robot=robot, arms=tuple(replace(arm, name=name) for name in names), motion=whole
        )

    return make
