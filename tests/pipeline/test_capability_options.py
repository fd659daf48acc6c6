"""Kinds of ellipsoids, joint limits as weights and payloads as options."""

from dataclasses import replace

import numpy as np
import pytest

from maniport import Arm, load_arm, transfer_recording
from maniport.errors import InvalidInputError, ManiportWarning
from maniport.pipeline.config import Config
from maniport.pipeline.settings import settings_of
from maniport.pipeline.stages import sample_robot


@pytest.mark.parametrize(
    ("options", "weights"),
    [({}, None), ({"ellipsoids": "force"}, "joint-limits"), ({"ellipsoids": "force", "joint_weights": "unit"}, None)],
)
def test_force_ellipsoids_have_torque_limits_by_default(options, weights):
    assert Config().changed(**options).spec.joint_weights == weights


@pytest.mark.parametrize(("options", "text"), [
    ({"ellipsoids": "velocity", "joint_weights": "joint-limits"}, "'myoarm' has no velocity limits"),
    ({"ellipsoids": "acceleration"}, "'myoarm' has none"), ({"payload": -1.0}, "payload"),
    ({"payload_center": (0.0, 0.0, 0.1)}, "payload_center= needs payload="),
    ({"payload": 1e30}, r"panda_joint\d needs .* N m, its limit is"),
    ({"payload": 20.0}, r"cannot hold itself .*panda_joint6 needs .* its limit is 12 N m"),
    ({"robot": "both", "payload": 1.0}, "is for one arm"),
])  # fmt: skip
def test_missing_limits_and_masses_are_named_before_the_recording_is_read(options, text):
    if options.get("robot") == "both":
        options |= {"robot": "panda", "pose": [(0.0, 0.3, 0.0, 0.0), (0.0, -0.3, 0.0, 0.0)]}
    with pytest.raises(InvalidInputError, match=text):
        transfer_recording("no recording", **options)


def test_a_robot_without_torque_limits_or_masses_is_refused():
    planar = load_arm("panda").from_dh("planar", [[0, 0, 0.4, 0]] * 3)
    with pytest.raises(InvalidInputError, match="'planar' has no effort limits"):
        transfer_recording("no recording", robot=planar, ellipsoids="force")
    with pytest.raises(InvalidInputError, match="payload needs masses"):
        transfer_recording("no recording", robot=planar, payload=1.0)
    with pytest.raises(InvalidInputError, match="no payload of its own; use payload="):
        transfer_recording("no recording", robot=load_arm("panda").with_payload(1.0))


def test_forces_without_gravity_are_said_to_be_so():
    weightless = Arm(replace(load_arm("panda").chain, inertia=None))
    settings = replace(settings_of(Config().changed(ellipsoids="force", n_student=8, move=False)), robot=weightless)
    with pytest.warns(ManiportWarning, match="forces are without gravity: .* has no masses"):
        sample_robot(settings)


def test_a_payload_is_carried():
    config = Config().changed(payload=2.0, payload_center=(0.0, 0.0, 0.1))
    robot, empty = settings_of(config).robot, load_arm("panda")
    q = np.array([0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 0.8])
    added = robot.gravity_torques(q) - empty.gravity_torques(q)
    center = (empty.forward(q) @ [0.0, 0.0, 0.1, 1.0])[:2]
    assert added[1] == pytest.approx(-2.0 * 9.81 * center[0], rel=1e-2)


def test_torque_limits_of_a_file_weight_the_ellipsoids(tmp_path):
    (tmp_path / "limits.yaml").write_text("default: {effort: 60.0}", encoding="utf-8")
    config = Config().changed(ellipsoids="force", limits=str(tmp_path / "limits.yaml"))
    np.testing.assert_array_equal(settings_of(config).robot.effort_limits, 60.0)
