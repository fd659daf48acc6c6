"""What is shown of results on their pages: a transfer, a robot's motion, the paper's arms."""

import dataclasses

import numpy as np
import pytest

import maniport as mp
from maniport.pipeline import transfer_recording
from maniport.report import facts_of
from maniport.report.page import as_html
from maniport.report.page.motions import motion_of, regularized
from sizes import SMALL, motion_alone, with_arm


@pytest.fixture(scope="module")
def shown(small_result):
    """What moves in the main job on a small scale."""
    return motion_of(small_result)


def page_of(result):
    """The page of a result, as text."""
    return as_html(facts_of(result), {"motion": [motion_of(result)]})


def test_transfer_shows_person_and_robot_together(small_result, shown):
    """The person's ellipsoid is at the hand; the target and the robot's own at the tool; path and clock are there."""
    person, robot = shown.bodies
    np.testing.assert_array_equal(shown.time, small_result.time)
    np.testing.assert_array_equal(person.ellipsoids["person"], small_result.arm.demonstrated_profile)
    np.testing.assert_array_equal(robot.ellipsoids["target"], small_result.arm.motion.target)
    np.testing.assert_array_equal(robot.ellipsoids["achieved"], small_result.arm.motion.achieved)
    tips = small_result.arm.robot.forward(small_result.arm.motion.joint_positions)[:, :3, 3]
    np.testing.assert_allclose(robot.skeleton[:, -1], tips, atol=1e-12)
    np.testing.assert_array_equal(robot.path, small_result.arm.motion.path)
    np.testing.assert_array_equal(shown.clocks["robot"], small_result.arm.motion.time)


def test_transfer_shows_all_curves(small_result, shown):
    """Distances with their floor, the tip's error, the ellipsoids' numbers and every joint with its limits."""
    panels = shown.panels
    distance, hand = panels["Distance and position error"]
    np.testing.assert_array_equal(distance.lines[0].values, small_result.arm.motion.distance)
    np.testing.assert_array_equal(distance.lines[1].values, small_result.arm.motion.pointwise_best)
    error = 1e3 * small_result.arm.motion.position_error
    np.testing.assert_allclose(hand.lines[0].values, np.maximum(error, 0.01))
    assert len(panels["Ellipsoids"]) == 4
    robot, person = panels["Joints of panda"], panels["Joints of the person"]
    assert [panel.title for panel in robot] == list(small_result.arm.robot.joint_names)
    assert {panel.unit for panel in (*robot, *person)} == {"°"}
    lower, upper = small_result.arm.robot.lower[0], small_result.arm.robot.upper[0]
    np.testing.assert_allclose(robot[0].limits, np.degrees([lower, upper]))
    angles = small_result.arm.motion.joint_positions[:, 0]
    np.testing.assert_allclose(robot[0].lines[0].values, np.degrees(angles))
    np.testing.assert_allclose(person[0].lines[0].values, np.degrees(small_result.arm.fit.joint_angles[:, 0]))


def test_alike_looks_alike(small_result, shown):
    """The camera turns with the path; on the map person and target have one frame, however the robot is mounted."""
    person, robot = shown.bodies
    assert [cloud.role for cloud in shown.map.domains] == ["person", "achieved"]
    assert [cloud.role for cloud in shown.map.profiles] == ["person", "target", "achieved"]
    np.testing.assert_array_equal(shown.map.profiles[1].gap, small_result.arm.gap)
    assert person.turn is None
    np.testing.assert_allclose(robot.turn, small_result.arm.placement.rotation, atol=1e-12)
    assert len(person.figure) > 3
    back, chart = robot.turn.T, shown.map
    np.testing.assert_allclose(
        chart.profiles[1].ellipsoids,
        small_result.arm.adapter.student_side(back @ small_result.arm.motion.target @ back.T), atol=1e-9,
    )  # fmt: skip
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    turned = regularized(dataclasses.replace(small_result, base_rotation=quarter))[1]["person"]
    np.testing.assert_allclose(turned, quarter @ chart.profiles[0].ellipsoids @ quarter.T, atol=1e-9)


@pytest.mark.parametrize("options", [{"part": "full"}, {"kind": "force"}])
def test_unmoved_robot_and_other_ellipsoids_are_shown(second, options):
    """Without a robot's motion the person alone moves; force ellipsoids are drawn as velocity ones, full ones not."""
    found = transfer_recording(
        second.crop(10.0, 10.3), method="parallel-transport", move=False, spec=mp.EllipsoidSpec(**options), **SMALL
    )
    shown = motion_of(found)
    assert [body.name for body in shown.bodies] == ["Person"]
    assert ("Ellipsoids" in shown.panels) == (options.get("part") != "full")
    assert len(page_of(found)) < 6_000_000
    if options.get("kind") == "force":
        velocity = found.arm.fit.arm.manipulability(found.arm.fit.joint_angles)
        np.testing.assert_allclose(shown.bodies[0].ellipsoids["person"], velocity, rtol=1e-6, atol=1e-9)


def test_robot_alone_is_shown(small_result):
    """A motion without a person has one body, no map, and no error of a path that does not exist."""
    motion = dataclasses.replace(small_result.arm.motion, path=None, position_error=None)
    execution = motion_alone(with_arm(small_result, motion=motion))
    shown = motion_of(execution)
    assert [body.name for body in shown.bodies] == ["panda"]
    assert shown.map is None
    assert [panel.title for panel in shown.panels["Distance and position error"]] == ["Ellipsoid distance"]
    assert "The motion of panda" in page_of(execution)


def test_surfaces_stand_where_forward_kinematics_puts_them(small_result, shown):
    """Each surface of the robot has the pose of the joint it hangs on; the person has none."""
    person, robot = shown.bodies
    assert person.parts == ()
    arm = small_result.arm.robot
    surfaces, poses = arm.surfaces(), arm.link_poses(small_result.arm.motion.joint_positions)
    assert len(robot.parts) == len(surfaces) > 1
    for part, surface in zip(robot.parts, surfaces, strict=True):
        np.testing.assert_array_equal(part.poses, poses[:, surface.joint])
        np.testing.assert_array_equal(part.triangles, surface.triangles)
        np.testing.assert_array_equal(part.points, surface.points)
