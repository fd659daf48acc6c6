"""What bad input gets: an error that names the argument, where, what was found and what is allowed.

The battery of `maniport.testing` tries bad matrices with all methods, `tests/util/test_validation.py` all kinds.
"""

import numpy as np
import pytest

import maniport as mp
from maniport.errors import InvalidInputError, NotSPDError
from maniport.transfer import EllipsoidCorrespondence, GeodesicCorrespondence, method_of

GOOD = np.stack(
    [np.diag([1.0, 2.0, 3.0]), np.diag([2.0, 1.0, 5.0]), np.diag([4.0, 2.0, 1.0]), np.eye(3)]
)


@pytest.mark.parametrize(
    ("method", "options", "message"),
    [
        ("parallel-transport", {"base_rotation": np.eye(2)}, "base_rotation.*2×2"),
        ("parallel-transport", {"base_rotation": 2.0 * np.eye(3)}, "base_rotation"),
        (
            "parallel-transport",
            {"base_rotation": np.diag([1.0, 1.0, -1.0])},
            "base_rotation.*determinant",
        ),
        ("parallel-transport", {"base_rotation": np.eye(3)[None]}, "base_rotation"),
        ("parallel-transport", {"base_rotation": np.full((3, 3), np.nan)}, "base_rotation"),
        ("icp", {"start": "random"}, "start"),
        ("icp", {"n_starts": -1}, "n_starts"),
        ("icp", {"n_starts": 2.5}, "n_starts"),
        ("icp", {"require_improvement": "no"}, "require_improvement"),
        ("icp", {"most_singular": 1}, "most_singular"),
        (
            "icp",
            {"correspondence": "nearest"},
            "unknown correspondence 'nearest'; available, nearest first: 'geodes",
        ),
        ("icp", {"correspondence": GeodesicCorrespondence}, "or a Correspondence; found <class"),
        ("icp", {"correspondence": None}, "correspondence"),
        ("icp", lambda: {"correspondence": EllipsoidCorrespondence(exponent="large")}, "exponent"),
        ("icp", lambda: {"correspondence": EllipsoidCorrespondence(exponent=-1)}, "exponent"),
        ("length-field", {"n_samples": 1}, "^n_samples"),
        ("length-field", {"n_centers": 0}, "^n_centers"),
        ("length-field", {"n_centers": 500}, "^n_centers"),
        ("length-field", {"width": 0.0}, "^width"),
        ("length-field", {"ridge": 0.0}, "^ridge"),
        ("length-field", {"n_rounds": 0}, "^n_rounds"),
    ],
)
def test_bad_options_are_refused_by_name(method, options, message):
    with pytest.raises(InvalidInputError, match=message):
        method_of(method).set_params(**options() if callable(options) else options).fit(
            GOOD, 2.0 * GOOD
        )


def test_points_of_another_size_or_count_are_refused():
    """In `transform`, `check_adapter` tries all bad points."""
    adapter = mp.ParallelTransport().fit(GOOD, 2.0 * GOOD)
    small = GOOD[:, :2, :2]
    for use in (
        adapter.inverse_transform,
        lambda x: adapter.score(x, GOOD),
        lambda x: adapter.errors(GOOD, x[:3]),
    ):
        with pytest.raises(InvalidInputError, match=r"2×2|4 and 3"):
            use(small)


def test_images_beyond_floating_point_numbers(random_spd):
    rng = np.random.default_rng(0)
    round_ = random_spd(rng, 20, 3, 1.001)
    long = random_spd(rng, 20, 3, 1e4)
    longer = random_spd(rng, 20, 3, 1e8)
    longest = random_spd(rng, 1, 3, 1e11)[0]
    with pytest.raises(InvalidInputError, match=r"^points.*range"):
        mp.ScaledTransport().fit(round_, long).transform(long)
    adapter = mp.ScaledTransport().fit(long, longer)
    with pytest.raises(NotSPDError, match=r"points\[3\].*singular"):
        adapter.transform([*long[:3], longest])
    with pytest.raises(NotSPDError, match=r"points .*singular"):
        adapter.transform(longest)
    mp.ParallelTransport(damping=1e-9).fit(round_, long)
