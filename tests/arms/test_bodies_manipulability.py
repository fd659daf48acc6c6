"""Laws of velocity and force ellipsoids."""

import numpy as np
import pytest

from maniport.arms import EllipsoidSpec, load_arm
from maniport.arms.manipulability import manipulability
from maniport.errors import InvalidInputError, NotSPDError


def test_singular_force_ellipsoid_is_refused(planar):
    """An unbounded force ellipsoid is an error that names the configuration and the way out."""
    with pytest.raises(NotSPDError, match=r"jacobian\[0\] is singular.*\(2 of 2\).*kind='velocity'"):
        planar.manipulability([[0.3, 0.5], [0.0, 0.0]], kind="force")
    with pytest.raises(NotSPDError, match=r"jacobian\[1\] is singular"):
        manipulability(np.stack([np.eye(6), np.diag([1.0, 0, 1, 1, 1, 1])]), EllipsoidSpec("force"))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"kind": "speed"}, "unknown kind 'speed'"),
        ({"part": "linear"}, "unknown part 'linear'"),
        ({"joint_weights": [1.0, 2.0]}, r"joint_weights must be 7 numbers above 0; found shape \(2,\)"),
        ({"joint_weights": [1, 1, 0, 1, 1, 1, 1]}, "joint_weights must be .* numbers above 0; found 0 at index 2"),
        ({"joint_weights": [[1.0]]}, r"joint_weights must be a sequence of numbers above 0; found shape \(1, 1\)"),
        ({"joint_weights": "limits"}, "unknown joint_weights 'limits'"),
    ],
)
def test_wrong_options_are_named(arguments, message):
    """A wrong option gets an error that says what was found and what is allowed."""
    panda = load_arm("panda")
    with pytest.raises(InvalidInputError, match=message):
        panda.manipulability(panda.sample(2, random_state=0), **arguments)


def test_unknown_velocity_limits_are_named(urdf):
    """Weights by velocity limits need them all: the joints without one are listed."""
    with pytest.raises(InvalidInputError, match=r"'myoarm' has no velocity limits for elv_angle, .*flexion; give"):
        load_arm("myoarm").manipulability(np.zeros(7), joint_weights="velocity-limits")
    with pytest.raises(InvalidInputError, match="'crane' has no velocity limits for turn, spin; give"):
        load_arm(urdf).manipulability(np.zeros(4), joint_weights="velocity-limits")
