import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from maniport.report.page.animation import animation_of
from maniport.report.page.content import write_scene


def test_the_recording_has_the_content_of_the_page(alone, tmp_path):
    chunk = pytest.importorskip("rerun.chunk")
    file = tmp_path / "motion.rrd"
    motion = animation_of(alone)
    write_scene(file, motion)
    assert list(tmp_path.iterdir()) == [file]
    static = {}
    moving = {}
    for one in chunk.RrdReader(file).stream().to_chunks():
        batch = one.to_record_batch()
        rows = {name: batch[name].to_pylist() for name in batch.schema.names if ":" in name}
        rows |= {name: batch[name].cast("int64").to_numpy() for name in one.timeline_names}
        (static if one.is_static else moving).setdefault(one.entity_path, {}).update(rows)
    robot = alone.robot.name
    body = motion.stages[-1].bodies[0]
    assert static[f"/{robot}/path"]
    for role, ellipsoids in body.ellipsoids.items():
        rows = moving[f"/{robot}/{role}"]
        sizes, quaternions, centers = (
            np.array(rows[f"Ellipsoids3D:{name}"])[:, 0]
            for name in ("half_sizes", "quaternions", "centers")
        )
        rotation = Rotation.from_quat(quaternions).as_matrix()
        squares = ((sizes / motion.size) ** 2)[..., None]
        assert_allclose(rotation @ (squares * np.swapaxes(rotation, 1, 2)), ellipsoids, atol=1e-5)
        assert_allclose(centers, body.skeleton[:, -1], atol=1e-6)
        assert_allclose(rows["time"], 1e9 * (motion.time - motion.time[0]), atol=1.0)
    assert body.parts
    for k, part in enumerate(body.parts):
        rows = moving[f"/{body.name}/links/{k}"]
        assert_allclose(
            np.array(rows["Transform3D:translation"])[:, 0], part.poses[:, :3, 3], atol=1e-6
        )
        assert static[f"/{body.name}/links/{k}"]
    curves = {path: rows for path, rows in moving.items() if path.startswith("/curves/")}
    assert len(curves) == sum(
        len(panel.lines) for panels in motion.panels.values() for panel in panels
    )
    scalars = next(
        rows["Scalars:scalars"] for path, rows in curves.items() if "panda_joint3" in path
    )
    positions = alone.arm.motion.joint_positions[:, 2]
    assert_allclose(np.array(scalars)[:, 0], np.degrees(positions), atol=1e-12)
