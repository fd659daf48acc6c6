"""Robots by name, out of packages: which of their joints and bodies are taken, and MuJoCo's Jacobians."""

import json
import os
from pathlib import Path

import numpy as np
import pytest
from robot_packages import farthest, model_of

from maniport.arms import load_arm
from maniport.arms.loaders import robot_limbs
from maniport.arms.loaders.packages import PACKAGES, find_robot
from maniport.errors import InvalidInputError, MissingPackageError, UnknownNameError

GOLDEN = json.loads((Path(__file__).parent / "robot_packages.json").read_text())
"""Base, tip and degrees of freedom of every arm, each looked at: what carries the gripper or the hand."""


def require(package: str) -> None:
    if not PACKAGES[package].installed() and not (
        os.environ.get("CI") and package == "example-robot-data"
    ):
        pytest.skip(f"{package} is not installed")


@pytest.mark.parametrize("package", PACKAGES)
def test_every_arm_is_taken_at_its_hand_and_equals_mujoco(package):
    """Base, tip and number of joints are the golden ones; poses and Jacobians are MuJoCo's to 1e-9."""
    mujoco = pytest.importorskip("mujoco")
    require(package)
    golden = {}
    for name, (base, tip, dof) in GOLDEN[package].items():
        for side in ("left", "right") if name in PACKAGES[package].pairs else ("",):
            arm = f"{name}_{side}_arm" if side else name
            golden[arm] = base, tip.replace("SIDE", side).replace("S_", f"{side[:1]}_"), dof
    assert set(golden) == set(PACKAGES[package].names)
    for name, expected in golden.items():
        arm = load_arm(f"{package}/{name}")
        assert (arm.chain.base, arm.frame, arm.dof) == expected, name
        assert np.all(np.isfinite(arm.manipulability(arm.sample(8, random_state=0)))), name
        assert (
            farthest(mujoco, model_of(mujoco, find_robot(f"{package}/{name}").path), arm) < 1e-9
        ), name


def test_two_arms_are_named_by_their_side():
    require("example-robot-data")
    with pytest.raises(InvalidInputError, match=r"'talos'.*'talos_left_arm'.*'talos_right_arm'"):
        load_arm("talos")
    assert load_arm("talos", frame="gripper_right_base_link").dof == 9
    limbs, default = robot_limbs("g1")
    assert default is None
    assert robot_limbs("g1_left_arm")[1] == limbs[0]
    tips = [limb.frame for limb in limbs]
    assert set(tips[:2]) == {"left_rubber_hand", "right_rubber_hand"}
    assert set(tips[2:]) == {"left_ankle_roll_link", "right_ankle_roll_link"}


def test_errors_of_unknown_robots_contain_the_installation(monkeypatch):
    for package in PACKAGES.values():
        monkeypatch.setattr(type(package), "installed", lambda self: {})
    message = r"'xarm7' comes with the package example-robot-data, .*: pip install"
    with pytest.raises(MissingPackageError, match=message):
        load_arm("xarm7")
    with pytest.raises(
        MissingPackageError,
        match=r"'sawyer'.*--no-deps robosuite",
    ):
        load_arm("robosuite/sawyer")
    with pytest.raises(
        UnknownNameError,
        match=r"'ur55'.*pip install example-rob.*'ur5'",
    ):
        load_arm("ur55")
