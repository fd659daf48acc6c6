"""Both arms over one trunk: each gives its angles back, in the same frames, and the hands keep their relation."""

import numpy as np
import pytest

import maniport as mp
from maniport.arms import load_arm
from maniport.arms.human import middle_of
from maniport.errors import ManiportWarning, RecordingError
from maniport.mocap import Recording, fit_arms, performed, read_recording

SIDES = ("left", "right")


@pytest.fixture(scope="module")
def both_arms():
    """Fit of the bundled recording of both arms; the left one exceeds limits of the model by much."""
    with pytest.warns(ManiportWarning) as said:
        fits = mp.fit_arms(read_recording("both-arms"))
    assert [str(one.message).split(":")[0] for one in said] == ["left arm"]
    return fits


def film(person, slow_motion, n=60):
    """Both arms of a model perform over one trunk that stands still; return the recording, the arms and angles."""
    arms = {side: load_arm(person, side=side) for side in SIDES}
    tracks, angles = {}, {}
    for k, (side, arm) in enumerate(arms.items()):
        time, q = slow_motion(arm, n=n)
        angles[side] = q[::-1] if k else q
        shot = performed(arm, angles[side], time)
        points = dict(zip(shot.names, np.moveaxis(shot.positions, 1, 0) - [0, middle_of(arm), 0], strict=True))
        tracks |= {name if "trunk" in name else f"{side}_{name}": track for name, track in points.items()}
    return Recording(tuple(tracks), np.stack(list(tracks.values()), axis=1), time), arms, angles


@pytest.mark.parametrize("person", ["myoarm", "rhuman"])
def test_both_arms_give_their_angles_and_the_relation_of_the_hands_back(person, slow_motion):
    """Of two arms that perform over one trunk each gets its joint angles, and the hands are apart as recorded."""
    recording, arms, angles = film(person, slow_motion)
    fits = fit_arms(recording, person)
    paths = {}
    for side, fit in zip(SIDES, fits.each, strict=True):
        assert fit.arm.side == side
        np.testing.assert_allclose(fit.joint_angles, angles[side], atol=1e-6)
        np.testing.assert_array_equal(fit.time, fits.time)
        paths[side] = arms[side].forward(angles[side])[:, :3, 3] - [0, middle_of(arms[side]), 0]
    np.testing.assert_allclose(fits.hands[1] - fits.hands[0], paths["right"] - paths["left"], atol=1e-6)
    np.testing.assert_allclose(fits.bases.sum(axis=0), 0.0, atol=1e-12)


def test_the_shipped_recording_shows_both_in_the_same_frames(both_arms):
    """Real markers are met to two degrees by arm and forearm of either side, in the frames that show both."""
    assert len(both_arms) == len(both_arms.left) == len(both_arms.right) == 272
    np.testing.assert_array_equal(both_arms.left.frames, both_arms.right.frames)
    for fit in both_arms.each:
        residuals = fit.residual_summary()
        assert max(residuals["upper arm"]["median"], residuals["forearm"]["median"]) < 2.5
        assert fit.determined.all()
    assert 0.1 < np.median(np.linalg.norm(both_arms.hands[1] - both_arms.hands[0], axis=-1)) < 1.0
    assert sum("frames in the middle are left out" in doubt for doubt in both_arms.quality_warnings) == 1
    assert len(both_arms.crop(3.0, 4.0)) < 41


def test_a_recording_of_one_arm_is_refused_at_once():
    """The message says which arm is there, what is missing of the other, and how that may be said."""
    with pytest.raises(RecordingError, match=r"both arms are asked for, and the recording shows the right one alone; "
                       r".*missing.*elbow"):  # fmt: skip
        fit_arms(read_recording("freeform"))
    single = performed(load_arm("rhuman"), np.zeros((4, 7)), np.arange(4.0))
    with pytest.raises(RecordingError, match="shows the right one alone"):
        fit_arms(single)
