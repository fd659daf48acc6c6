"""Surfaces of real robots: the Panda's that ship, and those of example-robot-data."""

import sys
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from drawn_arms import drawn
from scipy.spatial import cKDTree

from maniport.bodies import load_arm


def _example(name: str) -> Path:
    """A file of example-robot-data, which continuous integration need not have."""
    files = [Path(entry) / "cmeel.prefix/share/example-robot-data/robots" / name for entry in sys.path]
    found = [file for file in files if file.exists()]
    if not found:
        pytest.skip("example-robot-data is not installed")
    return found[0]


ROBOTS = {
    "panda_description/urdf/panda.urdf": "panda_hand",
    "ur_description/urdf/ur5_robot.urdf": "tool0",
    "talos_data/robots/talos_full_v2.urdf": "gripper_left_base_link",
}


@pytest.mark.parametrize("name", ROBOTS)
def test_real_robots_are_where_pinocchio_has_them(name):
    """All of an arm's corners coincide with those of Pinocchio's visuals on the same links at a random pose."""
    path = _example(name)
    arm = load_arm(path, frame=ROBOTS[name])
    q = arm.sample(1, random_state=1)[0]
    model = pin.buildModelFromUrdf(str(path))
    geometry = pin.buildGeomFromUrdf(model, str(path), pin.VISUAL, package_dirs=list(map(str, path.parents)))
    configuration = pin.neutral(model)
    for joint, value in zip(arm.joint_names, q, strict=True):
        configuration[model.joints[model.getJointId(joint)].idx_q] = value
    data, places = model.createData(), geometry.createData()
    pin.updateGeometryPlacements(model, data, geometry, places, configuration)
    expected = []
    for thing, place in zip(geometry.geometryObjects, places.oMg, strict=True):
        link = model.frames[thing.parentFrame].name
        mesh = thing.geometry
        if arm.chain.holds(link) and hasattr(mesh, "vertices"):
            used = sorted({row[k] for row in map(mesh.tri_indices, range(mesh.num_tris)) for k in range(3)})
            expected.append(mesh.vertices()[used] @ place.rotation.T + place.translation)
    distances, _ = cKDTree(drawn(arm, q)).query(np.concatenate(expected))
    assert distances.max() < 2e-6
    assert sum(len(s.triangles) for s in arm.surfaces()) <= 15_000
