"""The Rerun recording holds what the page shows."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from maniport.report.page.animation import animation_of
from maniport.report.scene_file import write_scene


@pytest.fixture(scope="module")
def scene(alone, tmp_path_factory):
    """A motion, and the rows of every place in its file, as Rerun's own reader gives them: static ones, others."""
    chunk = pytest.importorskip("rerun.chunk")
    file, motion = tmp_path_factory.mktemp("scene") / "motion.rrd", animation_of(alone)
    write_scene(file, motion)
    static, moving = {}, {}
    for one in chunk.RrdReader(file).stream().to_chunks():
        batch = one.to_record_batch()
        rows = {name: batch[name].to_pylist() for name in batch.schema.names if ":" in name}
        rows |= {name: batch[name].cast("int64").to_numpy() for name in one.timeline_names}
        (static if one.is_static else moving).setdefault(one.entity_path, {}).update(rows)
    assert list(file.parent.iterdir()) == [file]
    return motion, static, moving


def test_ellipsoids_come_back_at_the_end_effector(scene, alone):
    """From half sizes and quaternions the matrices are had again, at every time, where the tip is."""
    motion, static, moving = scene
    robot = alone.robot.name
    body = motion.stages[-1].bodies[0]
    for role, wanted in body.ellipsoids.items():
        rows = moving[f"/{robot}/{role}"]
        half = np.array(rows["Ellipsoids3D:half_sizes"])[:, 0] / motion.size
        turn = Rotation.from_quat(np.array(rows["Ellipsoids3D:quaternions"])[:, 0]).as_matrix()
        assert_allclose(turn @ (half[..., None] ** 2 * np.swapaxes(turn, 1, 2)), wanted, atol=1e-5)
        assert_allclose(
            np.array(rows["Ellipsoids3D:centers"])[:, 0], motion.stages[-1].bodies[0].skeleton[:, -1], atol=1e-6
        )
        assert_allclose(rows["time"], 1e9 * (motion.time - motion.time[0]), atol=1.0)
    assert static[f"/{robot}/path"]


def test_the_arm_moves_as_its_links_do(scene):
    """Each link stands where the arm has it."""
    motion, static, moving = scene
    body = motion.stages[-1].bodies[0]
    for k, part in enumerate(body.parts):
        rows = moving[f"/{body.name}/links/{k}"]
        assert_allclose(np.array(rows["Transform3D:translation"])[:, 0], part.poses[:, :3, 3], atol=1e-6)
        assert static[f"/{body.name}/links/{k}"]
    if not body.parts:
        assert_allclose(
            np.array(moving[f"/{body.name}/skeleton"]["LineStrips3D:strips"])[:, 0], body.skeleton, atol=1e-6
        )


def test_every_curve_of_the_page_is_there(scene, alone):
    """Joints in degrees, distances and errors, value for value."""
    motion, _, moving = scene
    lines = sum(len(panel.lines) for panels in motion.panels.values() for panel in panels)
    curves = {path: rows for path, rows in moving.items() if path.startswith("/curves/")}
    assert len(curves) == lines
    found = next(rows for path, rows in curves.items() if "panda_joint3" in path)
    positions = alone.arm.motion.joint_positions[:, 2]
    assert_allclose(np.array(found["Scalars:scalars"])[:, 0], np.degrees(positions), atol=1e-12)
