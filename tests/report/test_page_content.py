"""Content of the pages of results: a transfer, and a robot's motion."""

from dataclasses import replace

import numpy as np
import pytest

from maniport.pipeline import transfer_recording
from maniport.report import report_of
from maniport.report.page import as_html
from maniport.report.page.animation import animation_of
from sizes import SMALL


@pytest.fixture(scope="module")
def shown(result):
    """The animation of the main job on a small scale."""
    return animation_of(result)


def page_of(result):
    """Return the page of a result as text."""
    return as_html(report_of(result), {"motion": [animation_of(result)]})


def test_transfer_has_stages_of_person_and_robot(result, shown):
    """The person's ellipsoid is at the hand; target and achieved at the end effector; path and clock are there."""
    (person,), (robot,) = (stage.bodies for stage in shown.stages)
    np.testing.assert_array_equal(shown.time, result.time)
    np.testing.assert_array_equal(person.ellipsoids["person"], result.arm.demonstrated_profile)
    np.testing.assert_array_equal(robot.ellipsoids["target"], result.arm.motion.target)
    np.testing.assert_array_equal(robot.ellipsoids["achieved"], result.arm.motion.achieved)
    positions = result.arm.robot.forward(result.arm.motion.joint_positions)[:, :3, 3]
    np.testing.assert_allclose(robot.skeleton[:, -1], positions, atol=1e-12)
    np.testing.assert_array_equal(robot.path, result.arm.motion.path)
    np.testing.assert_array_equal(shown.clocks["robot"], result.arm.motion.time)


def test_transfer_has_all_curves(result, shown):
    """Distances with the best pointwise ones, the position error, the ellipsoids and every joint in degrees."""
    panels, motion = shown.panels, result.arm.motion
    distance, position = panels["Distance and position error"]
    np.testing.assert_array_equal(distance.lines[0].values, motion.distance)
    np.testing.assert_array_equal(distance.lines[1].values, motion.pointwise_best)
    np.testing.assert_allclose(position.lines[0].values, np.maximum(1e3 * motion.position_error, 0.01))
    assert len(panels["Ellipsoids"]) == 4
    robot, person = panels["Joints of panda"], panels["Joints of the person"]
    assert [panel.title for panel in robot] == list(motion.joint_names)
    assert {panel.unit for panel in (*robot, *person)} == {"°"}
    np.testing.assert_allclose(robot[0].limits, np.degrees([result.arm.robot.lower[0], result.arm.robot.upper[0]]))
    np.testing.assert_allclose(robot[0].lines[0].values, np.degrees(motion.joint_positions[:, 0]))
    np.testing.assert_allclose(person[0].lines[0].values, np.degrees(result.arm.fit.joint_angles[:, 0]))


def test_the_map_has_one_frame(result, shown):
    """The camera rotates with the path; on the map person and target have one frame at any base orientation."""
    person, robot = shown.stages
    assert [cloud.role for cloud in shown.map.domains] == ["person", "achieved"]
    assert [cloud.role for cloud in shown.map.profiles] == ["person", "target", "achieved"]
    assert person.rotation is None
    np.testing.assert_allclose(robot.rotation, result.arm.placement.rotation, atol=1e-12)
    assert len(person.torso) > 3
    back, chart = robot.rotation.T, shown.map
    np.testing.assert_allclose(
        chart.profiles[1].ellipsoids,
        result.arm.adapter.student_side(back @ result.arm.motion.target @ back.T),
        atol=1e-9,
    )
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    rotated = animation_of(replace(result, base_rotation=quarter)).map.profiles[0].ellipsoids
    np.testing.assert_allclose(rotated, quarter @ chart.profiles[0].ellipsoids @ quarter.T, atol=1e-9)


@pytest.mark.parametrize("options", [{"part": "full"}, {"kind": "force"}])
def test_unmoved_robot_and_other_ellipsoids_are_drawn(second, options):
    """Without a robot's motion the person alone moves; force ellipsoids are drawn as velocity ones, full ones not."""
    result = transfer_recording(second.crop(10.0, 10.3), method="parallel-transport", move=False, **options, **SMALL)
    shown = animation_of(result)
    assert [stage.name for stage in shown.stages] == ["Person"]
    assert ("Ellipsoids" in shown.panels) == (options.get("part") != "full")
    assert len(page_of(result)) < 6_000_000
    if options.get("kind") == "force":
        velocity = result.arm.fit.arm.manipulability(result.arm.fit.joint_angles)
        np.testing.assert_allclose(shown.stages[0].bodies[0].ellipsoids["person"], velocity, rtol=1e-6, atol=1e-9)


def test_robot_alone_is_drawn(alone, changed):
    """A motion without a person has one stage, no map, and no error of a path that does not exist."""
    motion = changed(alone, path=None, position_error=None)
    shown = animation_of(motion)
    assert [stage.name for stage in shown.stages] == ["panda"]
    assert shown.map is None
    assert [panel.title for panel in shown.panels["Distance and position error"]] == ["Ellipsoid distance"]
    assert "The motion of panda" in page_of(motion)


def test_surfaces_have_the_poses_of_forward_kinematics(result, shown):
    """Each surface of the robot has the pose of its joint; the person has none."""
    (person,), (robot,) = (stage.bodies for stage in shown.stages)
    assert person.parts == ()
    arm = result.arm.robot
    surfaces, poses = arm.surfaces(), arm.link_poses(result.arm.motion.joint_positions)
    assert len(robot.parts) == len(surfaces) > 1
    for part, surface in zip(robot.parts, surfaces, strict=True):
        np.testing.assert_array_equal(part.poses, poses[:, surface.joint])
        corners = surface.points[surface.triangles].astype(np.float32)
        np.testing.assert_array_equal(part.points[part.triangles], corners)


@pytest.mark.parametrize("count", [2, 3])
def test_every_arm_is_drawn(several, count):
    """Each arm has a body with its own ellipsoids and panels that name it; equal surfaces are drawn once."""
    shown = animation_of(several(count))
    assert [len(stage.bodies) for stage in shown.stages] == [count, count]
    assert all(set(body.ellipsoids) == {"target", "achieved"} for body in shown.stages[1].bodies)
    parts = [len(body.parts) for body in shown.stages[1].bodies]
    assert parts[0] > 0
    assert parts[1:] == [0] * (count - 1)
    names = ("Left", "Right", "Middle")[:count]
    titles = [panel.title for panel in shown.panels["Distance and position error"]]
    assert titles[:count] == [f"{name}: Ellipsoid distance" for name in names]
    joints = [panel.title for panel in shown.panels["Joints of robot"]]
    assert len(joints) == len(set(joints)) == 7 * count
    assert shown.map is None
    report = report_of(several(count))
    assert len(as_html(report, {report.sections[0].key: [shown]}).encode()) < 6_000_000
