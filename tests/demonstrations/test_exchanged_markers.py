"""The advice about wrist markers at many rotations of the forearm: following it helps, and it never turns round."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from maniport.bodies import myoarm
from maniport.demonstrations import fit_arm
from maniport.demonstrations.performed import performed

PAIR = ("wrist_ulnar", "wrist_radial")
TURN = "forearm about its axis"


def recorded(pronation, flexion, offset=0.0):
    """Record a right arm whose wrist markers sit so far around the forearm from where they belong [deg]."""
    arm, time = myoarm(), np.linspace(0, 2, 21)
    middle = {"elv_angle": 30, "shoulder_elv": 50, "shoulder_rot": -20, "elbow_flexion": 70, "deviation": 5}
    middle |= {"pro_sup": pronation, "flexion": flexion}
    swing = 5 * np.sin(np.pi * time[:, None] + np.arange(7))
    q = np.radians([middle[name] for name in arm.joint_names] + swing)
    recording = performed(arm, np.clip(q, arm.lower, arm.upper), time)
    wrist = recording.point("wrist")
    along = wrist - recording.point("elbow")
    turn = Rotation.from_rotvec(np.radians(offset) * along / np.linalg.norm(along, axis=1, keepdims=True))
    positions = recording.positions.copy()
    for name in PAIR:
        place = recording.names.index(name)
        positions[:, place] = wrist + turn.apply(positions[:, place] - wrist)
    return replace(recording, positions=positions)


def fitted(recording, order):
    """Fit with the markers in an order: the turn of the forearm [deg], and the order that is advised, if one is."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        fit = fit_arm(recording, markers={"wrist_axis": ([order[0]], [order[1]])})
    other = order[::-1]
    advised = any(repr([[other[0]], [other[1]]]) in doubt for doubt in fit.doubts)
    left_out = any(repr({"wrist_axis": None}) in doubt for doubt in fit.doubts)
    return fit.residual_summary()[TURN]["median"], advised, left_out


@pytest.mark.parametrize("flexion", [0, 40])
@pytest.mark.parametrize("pronation", [-80, -60, -40, 0, 40, 60, 80])
def test_exchanged_wrist_markers_are_found(pronation, flexion):
    """Right ones bring no advice; exchanged ones that the forearm cannot follow bring the advice to exchange them."""
    recording = recorded(pronation, flexion)
    assert fitted(recording, PAIR) == (pytest.approx(0.0, abs=0.1), False, False)
    turn, advised, left_out = fitted(recording, PAIR[::-1])
    assert advised == left_out == (turn > 25)
    assert advised == (abs(pronation) <= 60)


@pytest.mark.parametrize(
    ("pronation", "offset"), [(40, -100), (40, 80), (80, -100), (80, -60), (80, 80), (80, 120), (0, 60), (-40, 90)]
)
def test_the_advice_is_the_same_in_both_orders(pronation, offset):
    """An exchange is advised where it leaves the forearm within 25° of its markers; else to leave these out."""
    recording = recorded(pronation, 40, offset)
    for order in (PAIR, PAIR[::-1]):
        (turn, advised, left_out), (then, again, _) = fitted(recording, order), fitted(recording, order[::-1])
        assert left_out == (turn > 25)
        assert advised == (turn > 25 > then)
        assert not (advised and again)
