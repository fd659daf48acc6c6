"""What a bank of starts promises."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from maniport.arms import EllipsoidSpec, load_arm
from maniport.errors import FileFormatError, InvalidInputError, NotSPDError
from maniport.motion import SeedBank
from maniport.spd.regularization import Regularization
from maniport.util.files import save_arrays


def test_samples_are_found_again(panda, bank):
    """The first answer to the ellipsoid and hand position of a sample is that sample."""
    found = bank.query(bank.ellipsoids[:50], bank.tip_positions[:50], k=3)
    assert found.shape == (50, 3, 7)
    # the last joint changes neither
    assert_allclose(found[:, 0, :6], bank.joint_positions[:50, :6], atol=0)
    assert_allclose(panda.manipulability(bank.joint_positions), bank.ellipsoids, atol=0)


@pytest.mark.parametrize(
    "options",
    [
        {"spec": EllipsoidSpec(part="full", joint_weights="velocity-limits"), "damping": 0.2},
        {"spec": EllipsoidSpec(joint_weights=np.arange(1.0, 8.0)), "damping": Regularization.absolute(0.02)},
    ],
)
def test_files_keep_the_bank(panda, tmp_path, options):
    """What is read from a file answers like what was written to it."""
    written = SeedBank.build(panda, 256, **options)
    written.save(tmp_path / "bank.npz")
    read = SeedBank.load(tmp_path / "bank.npz", panda)
    assert read.damping.epsilon == written.damping.epsilon
    assert read.spec == written.spec
    assert_allclose(read.ellipsoids, written.ellipsoids, rtol=1e-12)
    assert_array_equal(read.query(written.ellipsoids[:9]), written.query(written.ellipsoids[:9]))


def test_files_of_another_arm_are_refused(panda, bank, tmp_path):
    """A bank of another arm, or of another tip of the same arm, is an error that says what to do."""
    bank.save(tmp_path / "bank.npz")
    for other, words in (
        (load_arm("myoarm"), "samples beyond the limits of elv_angle"),
        (load_arm("panda", frame="panda_hand_tcp"), "the tip is elsewhere"),
        (load_arm("panda", frame="panda_link4"), "it is of 7 joints"),
        (panda.narrowed(0.1 * panda.lower, panda.upper), "samples beyond the limits of panda_joint1"),
    ):
        with pytest.raises(InvalidInputError, match=rf"built for the arm 'panda'.*{words}.*SeedBank.build"):
            SeedBank.load(tmp_path / "bank.npz", other)


def test_other_files_are_refused(panda, tmp_path):
    """What is no start bank is named."""
    save_arrays(tmp_path / "other.npz", {"manipulability": np.eye(3)})
    with pytest.raises(FileFormatError, match=r"no start bank|not a start bank"):
        SeedBank.load(tmp_path / "other.npz", panda)
    with pytest.raises(FileFormatError, match="there is no such file"):
        SeedBank.load(tmp_path / "none.npz", panda)


def test_wrong_banks_are_named(panda, bank):
    """Wrong numbers of samples and dampings are errors, as are ellipsoids that the damping does not make positive."""
    with pytest.raises(InvalidInputError, match="n must be a whole number of at least 1"):
        SeedBank.build(panda, 0)
    with pytest.raises(InvalidInputError, match="damping must be a number above 0"):
        SeedBank.build(panda, 16, damping=0.0)
    with pytest.raises(InvalidInputError, match="damping must be above 0"):
        SeedBank.build(panda, 16, damping=None)
    with pytest.raises(InvalidInputError, match="found a floor"):
        SeedBank.build(panda, 16, damping=Regularization(eigenvalue_floor=1e-4))
    with pytest.raises(NotSPDError, match="indefinite"):
        bank.query(np.diag([-1.0, 1.0, 1.0])[None])
