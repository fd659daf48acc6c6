from dataclasses import replace

import numpy as np
import pytest

from maniport.pipeline import transfer_recording
from maniport.report import report_of
from maniport.report.page import as_html
from maniport.report.page.animation import animation_of
from sizes import SMALL


@pytest.fixture(scope="module")
def animation(result):
    return animation_of(result)


def page_of(result):
    return as_html(report_of(result), animation_of(result))


def test_a_transfer_has_stages_of_person_and_robot(result, animation):
    """The person's ellipsoid is at the hand, target and achieved at the end effector; surfaces move with the links."""
    (person,), (robot,) = (stage.bodies for stage in animation.stages)
    arm, motion = result.arm.robot, result.arm.motion
    np.testing.assert_array_equal(animation.time, result.time)
    np.testing.assert_array_equal(person.ellipsoids["person"], result.arm.demonstrated_profile)
    np.testing.assert_array_equal(robot.ellipsoids["target"], motion.target)
    np.testing.assert_array_equal(robot.ellipsoids["achieved"], motion.achieved)
    np.testing.assert_allclose(
        robot.skeleton[:, -1], arm.forward(motion.joint_positions)[:, :3, 3], atol=1e-12
    )
    np.testing.assert_array_equal(robot.path, motion.path)
    np.testing.assert_array_equal(animation.clocks["robot"], motion.time)
    assert person.parts == ()
    assert len(robot.parts) > 1
    for part, surface in zip(robot.parts, arm.surfaces(), strict=True):
        np.testing.assert_array_equal(
            part.poses, arm.link_poses(motion.joint_positions)[:, surface.joint]
        )
        corners = surface.points[surface.triangles].astype(np.float32)
        np.testing.assert_array_equal(part.points[part.triangles], corners)


def test_a_transfer_has_all_curves(result, animation):
    panels, motion = animation.panels, result.arm.motion
    distance, position = panels["Distance and position error"]
    np.testing.assert_array_equal(distance.lines[0].values, motion.distance)
    np.testing.assert_array_equal(distance.lines[1].values, motion.pointwise_best)
    reached = replace(motion, pointwise_best=motion.distance)
    alone = animation_of(replace(result, arms=(replace(result.arm, motion=reached),)))
    assert [line.name for line in alone.panels["Distance and position error"][0].lines] == [
        "achieved"
    ]
    np.testing.assert_allclose(
        position.lines[0].values, np.maximum(1e3 * motion.position_error, 0.01)
    )
    assert len(panels["Ellipsoids"]) == 4
    robot, person = panels["Joints of panda"], panels["Joints of the person"]
    assert [panel.title for panel in robot] == list(motion.joint_names)
    assert {panel.unit for panel in (*robot, *person)} == {"°"}
    np.testing.assert_allclose(
        robot[0].limits, np.degrees([result.arm.robot.lower[0], result.arm.robot.upper[0]])
    )
    np.testing.assert_allclose(robot[0].lines[0].values, np.degrees(motion.joint_positions[:, 0]))
    np.testing.assert_allclose(
        person[0].lines[0].values, np.degrees(result.arm.fit.joint_angles[:, 0])
    )


def test_the_camera_rotates_with_the_path(result, animation):
    person, robot = animation.stages
    assert person.rotation is None
    np.testing.assert_allclose(robot.rotation, result.arm.placement.rotation, atol=1e-12)
    assert len(person.torso) > 3


@pytest.mark.parametrize(
    "options", [{"part": "full"}, {"ellipsoids": "force", "joint_weights": "unit"}]
)
def test_unmoved_robots_and_other_ellipsoids_are_drawn(second, options):
    result = transfer_recording(
        second.crop(10.0, 10.3), method="parallel-transport", move=False, **options, **SMALL
    )
    animation = animation_of(result)
    assert [stage.name for stage in animation.stages] == ["Person"]
    assert ("Ellipsoids" in animation.panels) == (options.get("part") != "full")
    assert len(page_of(result)) < 6_000_000
    if options.get("ellipsoids") == "force":
        velocity = result.arm.fit.arm.manipulability(result.arm.fit.joint_angles)
        drawn = animation.stages[0].bodies[0].ellipsoids["person"]
        np.testing.assert_allclose(drawn, velocity, rtol=1e-6, atol=1e-9)


def test_a_motion_without_a_person_is_drawn(alone, changed):
    motion = changed(alone, path=None, position_error=None)
    animation = animation_of(motion)
    assert [stage.name for stage in animation.stages] == ["panda"]
    assert [panel.title for panel in animation.panels["Distance and position error"]] == [
        "Ellipsoid distance"
    ]
    assert "The motion of panda" in page_of(motion)


def test_every_arm_is_drawn(several):
    animation, count = animation_of(several(3)), 3
    assert [len(stage.bodies) for stage in animation.stages] == [count, count]
    bodies = animation.stages[1].bodies
    assert all(set(body.ellipsoids) == {"target", "achieved"} for body in bodies)
    assert [bool(body.parts) for body in bodies] == [True] + [False] * (count - 1)
    titles = [panel.title for panel in animation.panels["Distance and position error"]]
    assert titles[:count] == [
        f"{name}: Ellipsoid distance" for name in ("Left", "Right", "Middle")[:count]
    ]
    joints = {panel.title for panel in animation.panels["Joints of robot"]}
    assert len(joints) == len(animation.panels["Joints of robot"]) == 7 * count
    assert len(page_of(several(3)).encode()) < 6_000_000
