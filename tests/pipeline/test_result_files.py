"""Ellipsoids in the files of a result are of the kind of the run, and give the reported distance."""

import json

import numpy as np
import pytest

import maniport as mp
from maniport.arms import EllipsoidSpec, load_arms
from maniport.pipeline import follow_profile
from maniport.pipeline.config import Config
from maniport.report import as_numbers, report_of
from maniport.util.files import load_ellipsoids
from sizes import little_search, panda_profile

WEIGHTS = (2.0, 2.0, 1.0, 1.0, 3.0, 3.0, 3.0)


def distances(folder, power):
    """The two lines of docs/result_folder.md."""
    files = [np.load(folder / f"{name}.npz") for name in ("placed_profile", "joints")]
    size = files[0]["manipulability"].shape[-1]
    damping = files[1]["damping"]
    ellipsoids = [np.linalg.matrix_power(file["manipulability"], power) for file in files]
    return mp.spd.distance(*(ellipsoid + damping * np.eye(size) for ellipsoid in ellipsoids))


def followed(robot, arms, options):
    """A short motion along ellipsoids that are a little larger than those of the robots, and rotated."""
    _, time, joints, _, path = panda_profile()
    config = Config(**options)
    turn = np.kron(np.eye(config.spec.size // 3), mp.arms.chain.rotation_about(2, 0.4))
    profiles = [1.3 * turn @ arm.ellipsoids(joints, config.spec) @ turn.T for arm in arms]
    paths = [path + arm.forward(joints[0])[:3, 3] - path[0] for arm in arms]
    targets = []
    for arm, profile, hand_path in zip(arms, profiles, paths, strict=True):
        target = mp.motion.TargetTrajectory.checked(
            arm, time, profile, positions=hand_path, spec=config.spec
        )
        targets.append(target)
    with little_search():
        return follow_profile(robot, targets, config, collisions=False)


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"joint_weights": WEIGHTS},
        {"joint_weights": "joint-limits", "part": "rotation"},
        {"part": "full"},
        {"ellipsoids": "force"},
        {"ellipsoids": "force", "joint_weights": "unit"},
        {"ellipsoids": "force", "joint_weights": WEIGHTS, "part": "full"},
    ],
    ids=lambda options: "-".join(map(str, options.values()))[:40] or "default",
)
def test_two_lines_reproduce_the_distance(panda, tmp_path, options):
    result = followed(panda, [panda], options)
    mp.write_results(result, tmp_path / "out")
    motion = result.arm.motion
    spec = result.config.spec
    power = -1 if spec.kind == "force" else 1
    stored = np.load(tmp_path / "out" / "joints.npz")
    np.testing.assert_allclose(distances(tmp_path / "out", power), stored["distance"], atol=1e-6)
    np.testing.assert_array_equal(stored["distance"], motion.distance)

    achieved = load_ellipsoids(tmp_path / "out" / "joints.npz")[0]
    expected = panda.ellipsoids(stored["joint_positions"], spec)
    np.testing.assert_allclose(achieved, expected, rtol=1e-6, atol=1e-9 * expected.max())

    summary = json.loads((tmp_path / "out" / "summary.json").read_text())["motion"]
    assert summary["distance"]["median"] == pytest.approx(np.median(stored["distance"]))


@pytest.mark.parametrize("kind", ["velocity", "force"])
def test_the_angle_of_the_longest_axes_is_of_the_files(panda, tmp_path, kind):
    result = followed(panda, [panda], {"ellipsoids": kind})
    result.save(tmp_path / "out")
    longest = []
    for name in ("placed_profile", "joints"):
        ellipsoids = load_ellipsoids(tmp_path / "out" / f"{name}.npz")[0]
        longest.append(np.linalg.eigh(ellipsoids)[1][..., -1])
    cosines = np.abs(np.sum(longest[0] * longest[1], axis=1))
    angles = np.degrees(np.arccos(np.minimum(cosines, 1.0)))

    reported = np.degrees(result.arm.major_axis_angle)
    defined = np.isfinite(reported)
    assert defined.all()
    np.testing.assert_allclose(reported, angles, atol=1e-3)
    summary = as_numbers(report_of(result))["motion"]["major_axis_angle_deg"]
    assert summary["max"] == pytest.approx(angles.max(), abs=1e-3)


@pytest.mark.parametrize("kind", ["velocity", "force"])
def test_two_lines_reproduce_the_distances_of_two_arms(tmp_path, kind):
    group = load_arms("panda", bases=[(0.0, 0.4, 0.0), (0.0, -0.4, 0.0)])
    result = followed(group, group.arms, {"ellipsoids": kind})
    mp.write_results(result, tmp_path / "out")
    together = np.load(tmp_path / "out" / "joints.npz")
    for name, arm in zip(group.names, result.arms, strict=True):
        folder = tmp_path / "out" / arm.name
        np.testing.assert_allclose(
            distances(folder, -1 if kind == "force" else 1), arm.motion.distance, atol=1e-6
        )
        stored = np.load(folder / "joints.npz")
        for key in ("manipulability", "distance", "damping"):
            np.testing.assert_array_equal(stored[key], together[f"{name}_{key}"])


def test_force_ellipsoids_of_singular_configurations_are_finite():
    spec = EllipsoidSpec("force")
    singular = np.diag([0.0, 1.0, 3.0])[None]
    force = spec.of_bounded(singular)
    assert np.isfinite(force).all()
    np.testing.assert_allclose(np.linalg.inv(force), singular, atol=1e-6)
    np.testing.assert_array_equal(EllipsoidSpec().of_bounded(singular), singular)
