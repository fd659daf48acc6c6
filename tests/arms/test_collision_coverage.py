"""Configurations that are reported free of collisions are free of them, by the exact meshes of real robots.

`MANIPORT_NIGHTLY=1` runs all arms of example-robot-data with 5000 configurations each.
"""

import os

import pytest
from exact_meshes import ExactMeshes

from maniport.arms import load_arm
from maniport.arms.collisions import Collisions
from maniport.arms.loaders.packages import PACKAGES, find_robot
from real_robots import NEEDS_ROBOTS

NIGHTLY = bool(os.environ.get("MANIPORT_NIGHTLY"))
ROBOTS = PACKAGES["example-robot-data"]
NAMES = ("panda", *ROBOTS.names) if NIGHTLY else ("panda", "ur5")
COUNT = 5000 if NIGHTLY else 100


def file_of(name):
    """The URDF of an arm; that of example-robot-data for the Panda that comes with the package."""
    return ROBOTS.found()["panda"] if name == "panda" else find_robot(f"example-robot-data/{name}").path


def struck(arm, collisions, q, path):
    """Number of configurations that are free, and the pairs that touch in them by the exact meshes."""
    exact = ExactMeshes(path, arm.joint_names, arm.sample(100, 1))
    unchecked = {frozenset(text.split(" against ")) for text in collisions.unchecked}
    free = q[~collisions.collides(q)]
    pairs = [pair for one in free for pair in exact.touching(one) if frozenset(pair) not in unchecked]
    return len(free), sorted(pairs)


@NEEDS_ROBOTS
@pytest.mark.parametrize("name", NAMES)
def test_configurations_reported_free_are_free(name):
    """No pair of links that no joint joins touches, grippers open and closed, other limbs at rest."""
    arm = load_arm(name if name == "panda" else f"example-robot-data/{name}")
    collisions = Collisions.of(arm)
    if not collisions.known:
        pytest.skip(f"{name} has no meshes")
    free, pairs = struck(arm, collisions, arm.sample(COUNT, 7), file_of(name))
    assert free > 0.03 * COUNT
    assert pairs == []
