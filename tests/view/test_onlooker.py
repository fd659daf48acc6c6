"""The page that looks on while a robot follows live."""

import urllib.error
import urllib.request
from dataclasses import replace

import numpy as np
import pytest

from maniport.errors import InvalidInputError
from maniport.live import Moment

pytest.importorskip("viser")
from maniport.view.onlooker import Onlooker


@pytest.fixture
def moment(arms):
    """A robot at rest beside a person."""
    person, robot = (arm.sample(1, 0)[0] for arm in arms)
    own, other = (arm.manipulability(q) for arm, q in zip(arms, (person, robot), strict=True))
    tip = arms[1].forward(robot)[:3, 3]
    return Moment(1.0, "following", robot, np.zeros(7), other, tip, person, own, own, 0.5, 0.01)


def test_moments_are_drawn(arms, moment):
    """Nothing before the person is seen; then the robot stands as it is told; without the token nothing is answered."""
    page = Onlooker(*arms)
    try:
        page.show(replace(moment, person=None, target=None, demonstrated=None, distance=None))
        assert page._scene is None
        page.show(moment)
        moved = replace(moment, joint_positions=arms[1].sample(1, 1)[0])
        page.show(moved)
        assert "**following**" in page._words.content
        mesh = page._scene.sides[0].student._meshes[-1]
        surface = arms[1].surfaces()[-1]
        pose = arms[1].link_poses(moved.joint_positions)[surface.joint]
        np.testing.assert_allclose(mesh.position, pose[:3, 3], atol=1e-6)
        with urllib.request.urlopen(page.url, timeout=60) as answer:
            assert answer.status == 200
        with pytest.raises(urllib.error.HTTPError):
            urllib.request.urlopen(page.url.rsplit("/", 2)[0], timeout=60)
        with pytest.raises(InvalidInputError, match="3×3"):
            page.show(replace(moment, achieved=np.eye(6)))
    finally:
        page.stop()
