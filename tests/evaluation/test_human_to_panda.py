"""Tests of the study from human to Panda, at a small size."""

import numpy as np
import pytest

from maniport.studies.human_to_panda import EVALUATIONS, motions


@pytest.mark.filterwarnings("ignore:the model of the arm and the person differ")
def test_motions_are_those_of_the_paper_and_the_recordings():
    """Four motions of 50 ellipsoids; a recording is thinned to 150 frames of the person in it."""
    found = motions([*EVALUATIONS, "freeform"])
    assert [len(motion.profile) for motion in found] == [50, 50, 50, 50, 150]
    assert found[-1].person.name == "myoarm"
    assert all(np.all(np.linalg.eigvalsh(motion.profile) > -1e-12) for motion in found)
