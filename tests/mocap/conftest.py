from dataclasses import replace

import numpy as np
import pytest

from dialect_files import POINTS, mirrored, motion
from maniport import arms
from maniport.mocap import synthetic_recording

SIDES = ("elbow_medial", "elbow_lateral", "wrist_ulnar", "wrist_radial")


@pytest.fixture
def slow_motion():
    """Return a maker of joint paths well inside an arm's limits, at constant speeds or with ``curved`` swings."""

    def make(arm, n=60, seconds=2.0, curved=False):
        time = np.linspace(0.0, seconds, n)
        middle = (arm.upper + arm.lower) / 2
        half = (arm.upper - arm.lower) / 2
        phase = np.arange(arm.dof)
        swing = np.sin(phase) * (2 * time[:, None] / seconds - 1)
        if curved:
            swing = np.sin(2 * np.pi * 0.2 * time[:, None] + phase)
        return time, middle + 0.6 * half * swing

    return make


@pytest.fixture
def record():
    """Return a maker of recordings in which an arm moves on a trunk that stands still."""

    def make(arm, time, q, axes=True, hand=True):
        whole = synthetic_recording(arm, q, time, "synthetic")
        left_out = (() if axes else SIDES) + (() if hand else ("hand",))
        return whole.select([name for name in whole.names if name not in left_out])

    return make


@pytest.fixture(params=["myoarm", "rhuman"])
def arm(request):
    return getattr(arms, request.param)(upper_arm=0.31, forearm=0.26, hand=0.06)


@pytest.fixture(scope="session")
def made():
    """A motion of the right arm on a trunk that moves; the left arm hangs."""
    return motion()


@pytest.fixture(scope="session")
def markers(made):
    """The motion under the names of Plug-in Gait, one point missing once."""
    recording = made.recording(mirrored(POINTS["Plug-in Gait"]))
    positions = recording.positions.copy()
    positions[3, 1] = np.nan
    return replace(recording, positions=positions)
