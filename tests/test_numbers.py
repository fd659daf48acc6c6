"""Numbers beyond reason at the doors: they are refused, or their scale does not matter; nothing becomes nan."""

import numpy as np
import pytest

import maniport as mp
from maniport.errors import InvalidInputError, ManiportError
from maniport.tracking import place_path, plan_motion

TIME = np.linspace(0.0, 0.5, 5)
JOINTS = np.linspace([0.0, -0.5, 0.0, -2.0, 0.0, 1.8, 0.0], [0.1, -0.4, 0.1, -1.9, 0.0, 1.7, 0.0], 5)
PANDA = mp.load_arm("panda")
PROFILE, PATH = PANDA.manipulability(JOINTS), PANDA.forward(JOINTS)[:, :3, 3]
TURNS = PANDA.forward(JOINTS)[:, :3, :3]
CLOUD = mp.sample_domain(PANDA, 40, 0)


def followed(**changed):
    """Track with some arguments changed."""
    given = {"profile": PROFILE, "time": TIME, "path": PATH, "start": JOINTS[0]} | changed
    return mp.track(PANDA, given.pop("profile"), **given).distance


DOORS = {
    "profile": lambda x: followed(profile=PROFILE * x),
    "path": lambda x: followed(path=PATH * x),
    "time": lambda x: followed(time=TIME * x),
    "start": lambda x: followed(start=JOINTS[0] * x),
    "weights": lambda x: followed(weights=np.tile(np.eye(6), (5, 1, 1)) * x),
    "damping": lambda x: followed(damping=x),
    "rotations": lambda x: followed(rotations=TURNS * x),
    "planned profile": lambda x: plan_motion(PANDA, PROFILE * x, time=TIME, path=PATH),
    "planned time": lambda x: plan_motion(PANDA, PROFILE, time=TIME * x, path=PATH),
    "placed path": lambda x: place_path(PATH * x, PROFILE, PANDA),
    "teacher": lambda x: mp.ParallelTransport(damping=0.01).fit(CLOUD * x, CLOUD),
    "student": lambda x: mp.RiemannianICP(damping=0.01).fit(CLOUD, CLOUD * x),
    "joint weights": lambda x: PANDA.ellipsoids(JOINTS, mp.EllipsoidSpec(joint_weights=np.full(7, x))),
    "distance": lambda x: mp.spd.distance(PROFILE, PROFILE * x),
}


@pytest.mark.parametrize("name", DOORS)
def test_what_is_too_large_is_refused(name):
    """Numbers of 10^300 and infinities are named in an error of maniport's own."""
    for x in (1e300, np.inf):
        with np.errstate(over="ignore", invalid="ignore"), pytest.raises(InvalidInputError, match=r"e\+|inf|nan"):
            DOORS[name](x)


@pytest.mark.parametrize("name", ["profile", "path", "start", "weights", "damping", "joint weights", "distance"])
def test_what_is_too_small_gives_numbers_or_is_refused(name):
    """Numbers of 10^-320 are as good as zero, or refused."""
    try:
        found = DOORS[name](1e-320)
    except ManiportError:
        return
    assert np.isfinite(found).all()
    assert name in ("profile", "path", "damping", "weights")


@pytest.mark.parametrize("size", [1e308, 1e-320])
def test_the_size_of_weights_of_a_mean_does_not_matter(size):
    """Weights of the largest or the smallest numbers weigh alike."""
    np.testing.assert_allclose(mp.spd.mean(PROFILE, weights=np.full(5, size)), mp.spd.mean(PROFILE), rtol=1e-9)
