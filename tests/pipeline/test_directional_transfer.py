"""Force and speed along the person's lines: as targets, in results, and as exported files alone show them."""

import json
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import linprog

import maniport as mp
from maniport.arms.directional import half_sphere, line_extent
from maniport.arms.loaders.packages import find_robot
from maniport.errors import InvalidInputError, ManiportWarning
from maniport.motion.directions import path_tangents
from maniport.pipeline import Config
from maniport.pipeline.capability import (
    limited_person,
    person_lines,
    positions_only,
    usable_kinds,
    with_directions,
)
from maniport.pipeline.settings import settings_of
from real_robots import NEEDS_ROBOTS
from sizes import SMALL, little_search


def test_lines_of_a_person_are_those_of_the_largest_extents(second):
    fit = mp.fit_arm(second)
    half = half_sphere(256)
    for kind in ("force", "velocity"):
        lines, weights = person_lines(fit, kind)
        extents = line_extent(limited_person(fit.arm, kind), fit.joint_angles, half, kind)
        along = line_extent(limited_person(fit.arm, kind), fit.joint_angles, lines[:, :1], kind)
        assert np.median(along[:, 0] / extents.max(axis=1)) > 0.97
        assert weights.sum(axis=1) == pytest.approx(1.0)
        assert np.all(np.diff(weights, axis=1) <= 0.0)


@pytest.fixture(scope="module")
def fitted(second):
    """A transfer with lines of force and speed."""
    with little_search():
        transfer = mp.Transfer("panda", mp.pipeline.Config(**SMALL))
        human = transfer.read(second)
        return transfer.fit(human), human


def test_targets_have_the_lines_that_are_asked_for(fitted):
    transfer, human = fitted
    directions = transfer.directions(human)
    targets = transfer.map(human, directions)
    for word, kinds in {"none": [], "force": ["force"], "both": ["force", "velocity"]}.items():
        (target,) = with_directions(targets, directions, word)
        assert [each.kind for each in target.directions] == kinds
        assert target.with_ellipsoids
    (free,) = positions_only(targets)
    assert not free.directions
    assert not free.with_ellipsoids


def test_lines_may_be_of_the_path_or_given(fitted):
    transfer, human = fitted
    config = transfer.settings.config
    turn = mp.arms.chain.rotation_about(2, 0.7)

    along_path = replace(
        transfer, settings=replace(transfer.settings, config=config.changed(direction="path"))
    )
    for direction in along_path.directions(human)[0]:
        steps = np.gradient(human.hand_paths[0], human.motion.time, axis=0)
        fast = np.linalg.norm(steps, axis=1) > 0.5 * np.linalg.norm(steps, axis=1).max()
        cosines = np.sum(direction.lines[:, 0] * steps, axis=1) / np.linalg.norm(steps, axis=1)
        assert cosines[fast] == pytest.approx(1.0)
        np.testing.assert_allclose(direction.turned(turn).lines, direction.lines @ turn.T)

    given = replace(
        transfer,
        settings=replace(transfer.settings, config=config.changed(direction=(0.0, 2.0, 0.0))),
    )
    for direction in given.directions(human)[0]:
        expected = np.tile([0.0, 1.0, 0.0], (len(human.motion), 1, 1))
        np.testing.assert_allclose(direction.turned(turn).lines, expected)
    with pytest.raises(InvalidInputError, match="direction"):
        config.changed(direction=(0.0, 0.0, 0.0))


def test_a_resting_path_has_the_tangent_of_its_nearest_motion():
    time = np.arange(6.0)
    path = np.array([[0, 0, 0], [0, 0, 0], [0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 0, 0]], float)
    np.testing.assert_allclose(path_tangents(time, path), np.tile([1.0, 0.0, 0.0], (6, 1)))
    still = np.zeros((6, 3))
    np.testing.assert_allclose(path_tangents(time, still), np.tile([0.0, 0.0, 1.0], (6, 1)))


def test_missing_limits_are_a_warning_where_they_are_asked_for():
    person = mp.arms.PERSONS["rhuman"]()
    lever = mp.Arm.from_dh("lever", [[0.0, 0.0, 0.5, 0.0]]).with_limits(velocity=1.0)
    with pytest.warns(ManiportWarning, match="effort"):
        assert usable_kinds(person, lever, "both") == ["velocity"]
    assert usable_kinds(person, lever, "speed") == ["velocity"]


def test_small_results_compare_with_positions_only(small_result):
    force, speed = small_result.arm.capabilities
    assert (force.kind, speed.kind) == ("force", "velocity")
    for capability in (force, speed):
        motion = small_result.arm.motion
        expected = line_extent(
            small_result.arm.robot,
            motion.joint_positions,
            capability.lines[:, None],
            capability.kind,
        )
        np.testing.assert_allclose(capability.robot, expected[:, 0])
        assert capability.position_only.shape == capability.robot.shape
        assert capability.gain == pytest.approx(
            np.median(capability.robot) / np.median(capability.position_only)
        )
    assert speed.person is None
    np.testing.assert_allclose(np.linalg.norm(force.lines, axis=1), 1.0)


def lines_of(folder):
    """Read times and the lines of force and speed from the table of a result."""
    with (folder / "person.csv").open(encoding="utf-8") as file:
        header = file.readline().strip().split(",")
        rows = np.loadtxt(file, delimiter=",")
    lines = {}
    for what in ("force", "speed"):
        columns = [header.index(f"direction_{what}_{axis}") for axis in "xyz"]
        lines[what] = rows[:, columns]
    return rows[:, 0], lines


def recomputed(folder, robot, frame, lines):
    """Return forces and speeds at the waypoints of a result, by the URDF in Pinocchio and a linear program."""
    joints = np.load(folder / "joints.npz")
    model = pin.buildModelFromUrdf(str(find_robot(robot).path))
    data = model.createData()
    names = [str(name) for name in joints["joint_names"]]
    indices = [model.joints[model.getJointId(name)].idx_v for name in names]
    frame_id = model.getFrameId(frame)  # its base is that of the model
    forces = []
    speeds = []
    for q, strong, fast in zip(
        joints["joint_positions"], lines["force"], lines["speed"], strict=True
    ):
        whole = pin.neutral(model)
        for name, position in zip(names, q, strict=True):
            whole[model.joints[model.getJointId(name)].idx_q] = position
        pin.framesForwardKinematics(model, data, whole)
        jacobian = pin.computeFrameJacobian(
            model, data, whole, frame_id, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        )[:3, indices]
        gravity = pin.computeGeneralizedGravity(model, data, whole)[indices]
        torques = jacobian.T @ strong
        forces.append(np.min((model.effortLimit[indices] - np.abs(gravity)) / np.abs(torques)))

        limits = model.velocityLimit[indices]
        equal = np.hstack([jacobian, -fast[:, None]])
        bounds = [*((-limit, limit) for limit in limits), (0.0, None)]
        goal = np.append(np.zeros(len(limits)), -1.0)
        speeds.append(linprog(goal, A_eq=equal, b_eq=np.zeros(3), bounds=bounds).x[-1])
    return forces, speeds


def require_figures(folder, forces, speeds):
    """The medians of a summary are those of these forces and speeds."""
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    assert np.median(forces) == pytest.approx(summary["motion"]["force"]["robot"]["median"])
    assert np.median(speeds) == pytest.approx(
        summary["motion"]["velocity"]["robot"]["median"], rel=1e-4
    )


@NEEDS_ROBOTS
@pytest.mark.parametrize("robot", ["example-robot-data/panda", "ur5"])
def test_files_alone_show_force_and_speed(robot, tmp_path):
    """Pinocchio has Jacobians and gravity of the URDF file, a linear program the largest speed."""
    with little_search():
        result = mp.transfer_recording("freeform", robot=robot, start=2.0, stop=2.3, **SMALL)
        mp.write_results(result, tmp_path / "out")
    _, lines = lines_of(tmp_path / "out")
    values = recomputed(tmp_path / "out", robot, result.arm.motion.frame, lines)
    require_figures(tmp_path / "out", *values)


@NEEDS_ROBOTS
def test_lines_of_a_file_are_those_of_the_result(tmp_path):
    """A drawer that turns from x to y, pulled along the base's z at last; the file has signs at random."""
    robot = "example-robot-data/panda"
    time = np.linspace(1.9, 2.4, 6)
    angle = time - 1.9
    strong = np.stack([np.cos(angle), np.sin(angle), 0.1 * angle], axis=1)
    fast = np.tile([0.0, 0.6, -0.8], (6, 1))
    signs = np.array([1.0, -2.0, 3.0, 1.0, -1.0, 0.5])[:, None]
    table = np.column_stack([time, signs * strong, signs * fast])
    names = [f"direction_{what}_{axis}" for what in ("force", "speed") for axis in "xyz"]
    drawer = tmp_path / "drawer.csv"
    np.savetxt(drawer, table, delimiter=",", header=",".join(["time_s", *names]), comments="")

    part = {"robot": robot, "start": 2.0, "stop": 2.3, **SMALL}
    with little_search():
        result = mp.transfer_recording("freeform", directions=drawer, **part)
        mp.write_results(result, tmp_path / "out")
    at, lines = lines_of(tmp_path / "out")
    strong /= np.linalg.norm(strong, axis=1, keepdims=True)
    expected = {"speed": np.tile(fast[0], (len(at), 1))}
    expected["force"] = np.stack([np.interp(at, time, column) for column in strong.T], axis=1)
    expected["force"] /= np.linalg.norm(expected["force"], axis=1, keepdims=True)
    for what in ("force", "speed"):
        cosines = np.sum(lines[what] * expected[what], axis=1)
        np.testing.assert_allclose(np.abs(cosines), 1.0, atol=1e-6)
    values = recomputed(tmp_path / "out", robot, result.arm.motion.frame, expected)
    require_figures(tmp_path / "out", *values)
    for capability in result.arm.capabilities:
        assert capability.along == "direction"
        assert capability.is_target

    # the table of a result is such a file, and run.yaml names the file
    again = settings_of(Config(directions=tmp_path / "out" / "person.csv", **part))
    np.testing.assert_allclose(
        np.abs(np.sum(again.given_lines[0].at(at, "force") * lines["force"], axis=1)), 1.0
    )
    assert Config.load(tmp_path / "out" / "run.yaml").directions == (str(drawer),)


@pytest.mark.slow
def test_a_panda_is_stronger_where_the_person_is():
    result = mp.transfer_recording("freeform", start=2.0, stop=3.0)
    force, speed = result.arm.capabilities
    assert force.gain > 1.5
    assert speed.gain > 0.9
    assert result.motion.clearance.share == 0.0
