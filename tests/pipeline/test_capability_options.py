"""Kinds of ellipsoids, joint limits as weights and payloads as options."""

from dataclasses import replace

import numpy as np
import pytest

from maniport import Arm, load_arm, transfer_recording
from maniport.errors import InvalidInputError
from maniport.pipeline.config import Config
from maniport.pipeline.following import SampledRobot
from maniport.pipeline.settings import settings_of


@pytest.mark.parametrize(
    ("options", "weights"),
    [
        ({}, None),
        ({"ellipsoids": "force"}, "joint-limits"),
        ({"ellipsoids": "force", "joint_weights": "unit"}, None),
    ],
)
def test_force_ellipsoids_have_torque_limits_by_default(options, weights):
    assert Config().changed(**options).spec.joint_weights == weights


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (
            {"ellipsoids": "velocity", "joint_weights": "joint-limits"},
            "'myoarm' has no velocity limits",
        ),
        ({"payload": -1.0}, "payload"),
        ({"payload_center": (0.0, 0.0, 0.1)}, "payload_center= needs payload="),
        ({"payload": 1e30}, r"panda_joint\d needs .* N m, its limit is"),
        ({"payload": 20.0}, r"cannot hold itself .*panda_joint6 needs .* its limit is 12 N m"),
        (
            {"robot": "both", "payload": (1.0, 2.0, 3.0)},
            r"payload= of 'panda' must be one number or 2 numbers; found .*3",
        ),
        (
            {"robot": "both", "payload": (1.0, 20.0)},
            r"cannot hold itself .*right_panda_joint6 needs .* is 12 N m",
        ),
    ],
)
def test_missing_limits_and_masses_are_named_before_the_recording_is_read(options, text):
    if options.get("robot") == "both":
        options |= {"robot": "panda", "pose": [(0.0, 0.3, 0.0, 0.0), (0.0, -0.3, 0.0, 0.0)]}
    with pytest.raises(InvalidInputError, match=text):
        transfer_recording("no recording", **options)


def test_a_robot_without_torque_limits_or_masses_is_refused():
    planar = load_arm("panda").from_dh("planar", [[0, 0, 0.4, 0]] * 3)
    with pytest.raises(InvalidInputError, match=r"'planar'.*effort"):
        transfer_recording("no recording", robot=planar, ellipsoids="force")
    with pytest.raises(InvalidInputError, match=r"payload.*masses"):
        transfer_recording("no recording", robot=planar, payload=1.0)
    with pytest.raises(InvalidInputError, match="payload="):
        transfer_recording("no recording", robot=load_arm("panda").with_payload(1.0))


def test_forces_without_gravity_are_said_to_be_so():
    weightless = Arm(replace(load_arm("panda").chain, inertia=None))
    settings = replace(
        settings_of(Config().changed(ellipsoids="force", n_student=8, move=False)), robot=weightless
    )
    (text,) = SampledRobot.sample(settings).warnings
    assert "gravity" in text


@pytest.mark.parametrize(("payload", "masses"), [(2.0, (2.0, 2.0)), ((2.0, 0.5), (2.0, 0.5))])
def test_payloads_of_several_arms_are_those_of_each(payload, masses):
    poses = [(0.0, 0.3, 0.0, 0.0), (0.0, -0.3, 0.0, 0.0)]
    group = settings_of(Config(robot="panda", pose=poses, payload=payload)).robot
    assert tuple(arm.chain.payload for arm in group.arms) == masses
    q = np.array([0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 0.8])
    for arm, mass in zip(group.arms, masses, strict=True):
        np.testing.assert_allclose(
            arm.gravity_torques(q),
            load_arm("panda").with_payload(mass).gravity_torques(q),
            atol=1e-12,
        )


def test_payloads_and_limits_of_a_file_reach_the_robot(tmp_path):
    (tmp_path / "limits.yaml").write_text("default: {effort: 60.0}", encoding="utf-8")
    config = Config(
        payload=2.0,
        payload_center=(0.0, 0.0, 0.1),
        ellipsoids="force",
        limits=str(tmp_path / "limits.yaml"),
    )
    robot = settings_of(config).robot
    q = np.array([0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 0.8])
    loaded = load_arm("panda").with_payload(2.0, (0.0, 0.0, 0.1))
    np.testing.assert_allclose(robot.gravity_torques(q), loaded.gravity_torques(q))
    np.testing.assert_array_equal(robot.effort_limits, 60.0)
