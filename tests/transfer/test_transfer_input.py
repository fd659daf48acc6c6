"""What bad input gets: an error that names the argument, where, what was found and what is allowed.

The door is that of the contract: one method is tried with everything, the battery of `maniport.testing` tries all.
"""

import numpy as np
import pytest

import maniport as mp
from maniport.errors import InvalidInputError, NotSPDError
from maniport.transfer import EllipsoidCorrespondence, Search, method_of

GOOD = np.stack([np.diag([1.0, 2.0, 3.0]), np.diag([2.0, 1.0, 5.0]), np.diag([4.0, 2.0, 1.0]), np.eye(3)])
ASYMMETRIC, INDEFINITE, SINGULAR, BROKEN, ENDLESS = (GOOD.copy() for _ in range(5))
ASYMMETRIC[2, 0, 1] = 0.5
INDEFINITE[1, 0, 0] = -1.0
SINGULAR[3, 2, 2] = 0.0
BROKEN[1, 2, 2] = np.nan
ENDLESS[0, 1, 1] = np.inf

BAD_DOMAINS = {
    "a number": (1.0, "matrices"),
    "one matrix": (GOOD[0], "shape"),
    "too many axes": (GOOD[None], "shape"),
    "not square": (GOOD[:, :2], "square"),
    "words": ([[["a", "b"], ["c", "d"]]], "numbers"),
    "nothing": (None, "None"),
    "ragged": ([[[1.0, 0.0], [0.0]]], "numbers"),
    "empty": (GOOD[:0], "at least 2"),
    "one point": (GOOD[:1], "at least 2"),
    "1×1": (np.ones((4, 1, 1)), "1×1"),
    "asymmetric": (ASYMMETRIC, r"\[2\] is not symmetric"),
    "indefinite": (INDEFINITE, r"\[1\] is indefinite"),
    "nan": (BROKEN, r"\(1, 2, 2\)"),
    "infinite": (ENDLESS, r"\(0, 1, 1\)"),
    "equal": (np.repeat(GOOD[:1], 5, axis=0), "no dispersion"),
}


@pytest.mark.parametrize("name", ["teacher", "student"])
@pytest.mark.parametrize("bad", BAD_DOMAINS)
def test_bad_domains(name, bad):
    """A domain that cannot be used is refused by name, the same with every regularization."""
    value, message = BAD_DOMAINS[bad]
    domains = {"teacher": GOOD, "student": GOOD, name: value}
    for remedy in ({}, {"damping": 0.01}, {"eigenvalue_floor": 1e-4}):
        with pytest.raises(InvalidInputError, match=message) as caught:
            mp.ParallelTransport(**remedy).fit(**domains)
        assert str(caught.value).startswith(name)


def test_domains_of_different_size():
    """Teacher and student must have the same d."""
    with pytest.raises(InvalidInputError, match="student must hold 3×3 matrices; found 2×2"):
        mp.ParallelTransport().fit(GOOD, GOOD[:, :2, :2])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"base_rotation": np.eye(2)}, "base_rotation.*2×2"),
        ({"base_rotation": 2.0 * np.eye(3)}, "base_rotation"),
        ({"base_rotation": np.diag([1.0, 1.0, -1.0])}, "base_rotation.*determinant"),
        ({"base_rotation": np.eye(3)[None]}, "base_rotation"),
        ({"base_rotation": np.full((3, 3), np.nan)}, "base_rotation"),
        ({"dispersion": "median"}, "dispersion"),
        ({"scale": "no"}, "scale"),
    ],
)
def test_bad_options_of_rigid_methods(options, message):
    """Base rotation, dispersion and scale are checked by name."""
    with pytest.raises(InvalidInputError, match=message):
        mp.ParallelTransport(**options).fit(GOOD, GOOD)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (lambda: {"search": Search(start="random")}, "start"),
        (lambda: {"search": Search(n_starts=-1)}, "n_starts"),
        (lambda: {"search": Search(n_starts=2.5)}, "n_starts"),
        (lambda: {"correspondence": EllipsoidCorrespondence(exponent="large")}, "exponent"),
        (lambda: {"correspondence": EllipsoidCorrespondence(exponent=-1)}, "exponent"),
        (lambda: {"search": Search(most_singular=1)}, "most_singular"),
        (lambda: {"search": Search(max_iter=0)}, "max_iter"),
        (lambda: {"search": Search(tol=0.0)}, "tol"),
        (lambda: {"random_state": "today"}, "random_state"),
    ],
)
def test_bad_options_of_icp(options, message):
    """The options of the search are checked by name."""
    with pytest.raises(InvalidInputError, match=message):
        mp.RiemannianICP(**options()).fit(GOOD, GOOD)


@pytest.mark.parametrize(
    ("method", "name", "value"),
    [
        ("length-field", "n_samples", 1),
        ("length-field", "n_centers", 0),
        ("length-field", "width", 0.0),
        ("length-field", "ridge", 0.0),
        ("length-field", "n_rounds", 0),
    ],
)
def test_bad_options_of_other_methods(method, name, value):
    """Ends of the range of every option, which do not belong to it, are refused by the option's name."""
    with pytest.raises(InvalidInputError, match=rf"^{name} must be .*; found {value!r}"):
        method_of(method).set_params(**{name: value}).fit(GOOD, 2.0 * GOOD)


@pytest.mark.parametrize(
    "remedy", [{}, {"damping": 0.01}, {"eigenvalue_floor": 1e-4}], ids=["none", "damping", "eigenvalue_floor"]
)
def test_bad_points(remedy):
    """What is to be mapped is checked like the domains, and must have the adapter's d."""
    adapter = mp.ParallelTransport(**remedy).fit(GOOD, 2.0 * GOOD)
    sides = (adapter.teacher_side, adapter.student_side)
    for use in (adapter.transform, adapter.inverse_transform, lambda x: adapter.score(x, GOOD), *sides):
        with pytest.raises(InvalidInputError, match="points must hold 3×3 matrices; found 2×2"):
            use(GOOD[:, :2, :2])
        with pytest.raises(NotSPDError, match=r"points\[1\] is indefinite"):
            use(INDEFINITE)
        with pytest.raises(InvalidInputError, match="points must be finite; found nan"):
            use(BROKEN)
    with pytest.raises(InvalidInputError, match="equally many; found 4 and 3"):
        adapter.errors(GOOD, GOOD[:3])
    with pytest.raises(InvalidInputError, match="student must hold 3×3"):
        adapter.score(GOOD, GOOD[:, :2, :2])
    with pytest.raises(InvalidInputError, match="student must hold at least 1"):
        adapter.gaps(GOOD, GOOD[:0])


def test_images_beyond_floating_point_numbers(random_spd):
    """Where dilation leaves the floating-point numbers there is an error instead of nan or an indefinite matrix."""
    rng = np.random.default_rng(0)
    round_, long, longer = random_spd(rng, 20, 3, 1.001), random_spd(rng, 20, 3, 1e4), random_spd(rng, 20, 3, 1e8)
    longest = random_spd(rng, 1, 3, 1e11)[0]
    with pytest.raises(InvalidInputError, match="points takes the result out of range"):
        mp.ParallelTransport().fit(round_, long).transform(long)
    adapter = mp.ParallelTransport().fit(long, longer)
    with pytest.raises(NotSPDError, match=r"points\[3\] has an image whose eigenvalues are too far apart"):
        adapter.transform([*long[:3], longest])
    with pytest.raises(NotSPDError, match="points has an image"):
        adapter.transform(longest)
    mp.ParallelTransport(damping=1e-9).fit(round_, long)
