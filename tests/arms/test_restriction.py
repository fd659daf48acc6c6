import numpy as np
import pytest

from maniport.arms import load_arm
from maniport.errors import UnknownNameError


def test_a_part_is_the_whole_arm_with_coordinates_held():
    whole, part = load_arm("panda"), load_arm("panda", base="panda_link3")
    q = whole.sample(4, random_state=1)
    before = load_arm("panda", frame="panda_link3").forward(q[:, :3])
    np.testing.assert_allclose(before @ part.forward(q[:, 3:]), whole.forward(q), atol=1e-12)
    np.testing.assert_array_equal(part.velocity_limits, whole.velocity_limits[3:])
    assert part.frames[0] == "panda_link3"
    with pytest.raises(UnknownNameError, match="unknown base 'panda_link2'"):
        part.restricted(base="panda_link2")
    some = load_arm("panda", joints=["panda_joint1", "panda_joint2"], lock={"panda_joint4": -1.5})
    q = np.array([0.3, -0.2, 0.0, -1.5, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(some.forward(q[:2]), whole.forward(q), atol=1e-12)
    assert some.chain.locked == pytest.approx(dict(zip(whole.joint_names[2:], q[2:], strict=True)))
    np.testing.assert_array_equal(some.restricted(frame="panda_link3").chain.frames["panda_link0"].placement, np.eye(4))
