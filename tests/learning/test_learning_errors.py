import numpy as np
import pytest

from maniport.errors import InvalidInputError
from maniport.learning import ProfileGMM, align, tracking_weights

GOOD = np.broadcast_to(np.eye(3), (4, 3, 3)).copy()
TIME = np.linspace(0.0, 1.0, 40)
EYES = np.broadcast_to(np.eye(3), (40, 3, 3)) * (1 + TIME[:, None, None])
SQUARE = np.broadcast_to(np.eye(6), (3, 6, 6))
ONE, HALF = ProfileGMM(1), TIME[:, None, None] > 0.5


@pytest.mark.parametrize(("call", "words"), [
    (lambda: align([]), "profiles"), (lambda: align([GOOD, np.where(np.eye(3) > 0, np.nan, GOOD)]), r"profiles\[1\]"),
    (lambda: align([GOOD, GOOD * [1.0, 1.0, 0.0]]), r"profiles\[1\]\[0\] is singular"),
    (lambda: align([GOOD, GOOD[:, :2, :2]]), "3×3 matrices; found 2×2"),
    (lambda: align([GOOD, GOOD[:1]]), r"profiles\[1\]"), (lambda: align([GOOD, GOOD], reference=2), "reference"),
    (lambda: align([GOOD, GOOD], reference=-1), "reference"), (lambda: align([GOOD, GOOD], [[0, 1, 2, 3]]), "times"),
    (lambda: align([GOOD], [[0, 1, 2]]), r"times\[0\]"), (lambda: align([GOOD], [[0, 2, 1, 3]]), r"times\[0\]"),
    (lambda: align([GOOD, GOOD]).warp([[0.0]]), "signals"),
    (lambda: align([GOOD, GOOD]).warp([np.zeros((4, 3)), np.zeros((3, 3))]), r"signals\[1\]"),
    (lambda: ONE.fit(TIME, np.where(HALF, np.nan, EYES)), "ellipsoids"),
    (lambda: ONE.fit(TIME[1:], EYES), "time must be 40 numbers"), (lambda: ONE.fit(np.ones(40), EYES), "time"),
    (lambda: ProfileGMM(6).fit(TIME, EYES), "48 ellipsoids, .* found 40"),
    (lambda: ONE.fit(TIME, EYES, [1, 2]), "groups"), (lambda: ONE.fit(TIME, EYES, np.zeros(40)), "groups"),
    (lambda: ProfileGMM(0).fit(TIME, EYES), "n_components"),
    (lambda: ONE.fit(TIME, EYES).predict(np.ones((2, 3))), "time"),
    (lambda: ONE.fit(TIME, EYES).predict([np.nan]), "time"),
    (lambda: ONE.fit(TIME, EYES).predict([1e6]), "the prediction at these times"),
    (lambda: tracking_weights(SQUARE * np.nan), "covariance"),
    (lambda: tracking_weights(np.ones((3, 6))), "covariance"),
    (lambda: tracking_weights(0.0 * SQUARE), "covariance is zero"),
    (lambda: tracking_weights(np.ones((1, 6, 6)), 0.0), "singular"),
    (lambda: tracking_weights(-SQUARE), "no negative eigenvalue"), (lambda: tracking_weights(SQUARE, -0.1), "damping"),
])  # fmt: skip
def test_wrong_arguments_are_rejected(call, words):
    with pytest.raises(InvalidInputError, match=words):
        call()
