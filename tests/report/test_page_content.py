from dataclasses import replace

import numpy as np
import pytest
from pages import motion_of
from scipy.spatial.transform import Rotation

from maniport.arms.directional import line_extent
from maniport.pipeline import transfer_recording
from maniport.pipeline.capability import limited_person
from maniport.report import report_of
from maniport.report.page import as_html, templates
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
    arm = result.arm.robot
    motion = result.arm.motion
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
    panels = animation.panels
    motion = result.arm.motion
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
    robot = panels["Joints of panda"]
    person = panels["Joints of the person"]
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
    assert robot.torso is None
    mirrored = person.torso * [1, -1, 1, 1, -1, 1, 1]
    swapped = mirrored[:, [3, 4, 5, 0, 1, 2, 6]]
    for rod in person.torso:
        assert (rod == np.concatenate([mirrored, swapped])).all(axis=1).any()
    drawn = motion_of(page_of(result))["stages"]
    np.testing.assert_allclose(drawn[0]["torso"], person.torso, atol=1e-4)
    np.testing.assert_allclose(drawn[1]["rotation"], robot.rotation.ravel(), atol=1e-12)


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
    page = page_of(motion)
    assert "The motion of panda" in page
    (stage,) = motion_of(page)["stages"]
    assert (stage["name"], stage["torso"]) == ("panda", None)


def test_every_arm_is_drawn(several):
    animation = animation_of(several(3))
    count = 3
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


def test_arrows_are_force_and_speed_along_the_lines(result, animation):
    """The robot's are in its base frame, the person's along the same lines in the trunk frame."""
    (person,), (robot,) = (stage.bodies for stage in animation.stages)
    arrows = {(arrow.kind, arrow.role): arrow for arrow in robot.arrows}
    persons = {arrow.kind: arrow for arrow in person.arrows}
    fit = result.arm.fit
    titles = [panel.title for panel in animation.panels["Force and speed"]]
    assert [kind.title for kind in animation.arrows.values()] == titles
    for capability in result.arm.capabilities:
        kind = capability.kind
        achieved = arrows[kind, "achieved"]
        reference = arrows[kind, "reference"]
        np.testing.assert_array_equal(achieved.values, capability.robot)
        np.testing.assert_array_equal(reference.values, capability.position_only)
        np.testing.assert_array_equal(reference.lines, capability.lines)
        assert reference.dashed
        assert not achieved.dashed
        size = animation.arrows[kind].size
        drawn = [capability.robot, capability.position_only]
        if kind == "velocity":
            assert persons[kind].values is None
        else:
            lines = persons[kind].lines
            arm = limited_person(fit.arm, kind)
            along = line_extent(arm, fit.joint_angles, lines[:, None], kind)[:, 0]
            np.testing.assert_allclose(persons[kind].values, along)
            drawn.append(capability.person)
        assert 0.15 < size * np.percentile(np.concatenate(drawn), 95) <= 0.4 + 1e-9
        assert f"{0.1 / size:g} {animation.arrows[kind].unit}" in animation.note


def test_forces_near_a_singular_configuration_do_not_shrink_the_other_arrows(result, animation):
    force, speed = result.arm.capabilities
    robot = force.robot.copy()
    robot[3] = 1e6
    capabilities = (replace(force, robot=robot), speed)
    other = animation_of(replace(result, arms=(replace(result.arm, capabilities=capabilities),)))
    assert other.arrows["force"].size == animation.arrows["force"].size
    assert "are cut" in other.note
    assert "are cut" not in animation.note


def test_results_without_lines_have_no_arrows(result, alone):
    bare = replace(result, arms=(replace(result.arm, capabilities=()),))
    for each in (alone, bare):
        animation = animation_of(each)
        assert not animation.arrows
        assert "Force and speed" not in animation.panels
        assert not any(body.arrows for stage in animation.stages for body in stage.bodies)
        assert "Arrows" not in animation.note


def test_scale_and_rotation_of_the_path_are_stated_at_the_robot(result, animation):
    person, robot = animation.stages
    assert person.note == ""
    assert f"{result.arm.placement.scale:.2f}" in robot.note
    angle = Rotation.from_matrix(robot.rotation).magnitude()
    assert f"{np.degrees(angle):.0f}°" in robot.note


def test_the_position_error_has_its_tolerance(result, animation):
    panel = animation.panels["Distance and position error"][1]
    tolerance = panel.lines[1]
    assert tolerance.name == "tolerance"
    np.testing.assert_allclose(tolerance.values, 1e3 * result.arm.motion.position_tolerance)
    assert "tolerance</small>" in page_of(result)


@pytest.mark.parametrize(("value", "text"), [(1234.0, "1230"), (44.67, "44.7"), (0.5, "0.5")])
def test_numbers_of_cards_have_no_power_of_ten(value, text):
    template = templates().from_string("{{ value|digits }}")
    assert template.render(value=value) == text
