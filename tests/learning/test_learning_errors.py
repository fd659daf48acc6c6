"""Wrong arguments of `maniport.learning` raise an error that names the argument."""

import numpy as np
import pytest

from maniport.errors import InvalidInputError, NotSPDError
from maniport.learning import ProfileGMM, align, tracking_weights

GOOD = np.broadcast_to(np.eye(3), (4, 3, 3)).copy()
TIME = np.linspace(0.0, 1.0, 40)
EYES = np.broadcast_to(np.eye(3), (40, 3, 3)) * (1 + TIME[:, None, None])
SQUARE = np.broadcast_to(np.eye(6), (3, 6, 6))
ONE, HALF = ProfileGMM(1), TIME[:, None, None] > 0.5


@pytest.mark.parametrize(
    ("call", "words", "error"),
    [
        (lambda: align([]), "profiles", InvalidInputError),
        (
            lambda: align([GOOD, np.where(np.eye(3) > 0, np.nan, GOOD)]),
            r"profiles\[1\] must be finite",
            InvalidInputError,
        ),
        (lambda: align([GOOD, GOOD * [1.0, 1.0, 0.0]]), r"profiles\[1\]\[0\] is singular", NotSPDError),
        (lambda: align([GOOD, GOOD[:, :2, :2]]), "3×3 matrices; found 2×2", InvalidInputError),
        (lambda: align([GOOD, GOOD[:1]]), r"profiles\[1\] must hold at least 2", InvalidInputError),
        (lambda: align([GOOD, GOOD], reference=2), "reference", InvalidInputError),
        (lambda: align([GOOD, GOOD], reference=-1), "reference", InvalidInputError),
        (lambda: align([GOOD, GOOD], [[0, 1, 2, 3]]), "times must be 2 arrays", InvalidInputError),
        (lambda: align([GOOD], [[0, 1, 2]]), r"times\[0\] must have shape", InvalidInputError),
        (lambda: align([GOOD], [[0, 2, 1, 3]]), r"times\[0\] must increase", InvalidInputError),
        (lambda: align([GOOD, GOOD]).warp([[0.0]]), "signals must be 2", InvalidInputError),
        (lambda: align([GOOD, GOOD]).warp([np.zeros((4, 3)), np.zeros((3, 3))]), r"signals\[1\]", InvalidInputError),
        (
            lambda: ONE.fit(TIME, np.where(HALF, np.nan, EYES)),
            "ellipsoids must be",
            InvalidInputError,
        ),
        (lambda: ONE.fit(TIME[1:], EYES), "equally many; found 39 and 40", InvalidInputError),
        (lambda: ONE.fit(np.ones(40), EYES), "inputs must not all be equal", InvalidInputError),
        (lambda: ProfileGMM(6).fit(TIME, EYES), "48 ellipsoids, .* found 40", InvalidInputError),
        (lambda: ONE.fit(TIME, EYES, [1, 2]), "groups must have shape", InvalidInputError),
        (lambda: ONE.fit(TIME, EYES, np.zeros(40)), "groups must hold", InvalidInputError),
        (lambda: ProfileGMM(0).fit(TIME, EYES), "n_components", InvalidInputError),
        (lambda: ProfileGMM(1, random_state="x").fit(TIME, EYES), "random_state", InvalidInputError),
        (lambda: ONE.fit(TIME, EYES).predict(np.ones((2, 3))), "inputs must have 1 columns", InvalidInputError),
        (lambda: ONE.fit(TIME, EYES).predict([np.nan]), "inputs must be finite", InvalidInputError),
        (lambda: ONE.fit(TIME, EYES).predict([1e6]), "the prediction at these inputs", InvalidInputError),
        (lambda: tracking_weights(SQUARE * np.nan), "covariance must be finite", InvalidInputError),
        (lambda: tracking_weights(np.ones((3, 6))), "covariance must have shape", InvalidInputError),
        (lambda: tracking_weights(0.0 * SQUARE), "covariance is zero", InvalidInputError),
        (lambda: tracking_weights(np.ones((1, 6, 6)), 0.0), "singular", InvalidInputError),
        (lambda: tracking_weights(-SQUARE), "no negative eigenvalue", NotSPDError),
        (lambda: tracking_weights(SQUARE, -0.1), "damping", InvalidInputError),
    ],
)
def test_wrong_arguments_are_rejected(call, words, error):
    with pytest.raises(error, match=words):
        call()
