"""The base_rotation belongs to the contract: every method sees the teacher's ellipsoids in the student's frame."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import special_ortho_group

import maniport as mp
from maniport import spd
from maniport.errors import InvalidInputError
from maniport.motion import FeasibleProjector, SeedBank
from maniport.report import as_markdown, report_of
from maniport.spd.kernels import congruence
from maniport.transfer import METHODS, method_of

TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
methods = pytest.mark.parametrize("name", METHODS)


@methods
def test_a_rotation_in_space_turns_translation_and_rotation_alike(name, random_spd):
    rng = np.random.default_rng(0)
    teacher = random_spd(rng, 20, 6)
    student = random_spd(rng, 25, 6)
    both = np.kron(np.eye(2), TURN)
    short, long = (
        method_of(name, base_rotation=turn, random_state=0).fit(teacher, student)
        for turn in (TURN, both)
    )
    assert_array_equal(short.transform(teacher), long.transform(teacher))
    assert_allclose(short.map_rotation_, TURN, atol=1e-12)
    assert (
        method_of(name, base_rotation=np.eye(6), random_state=0)
        .fit(teacher, student)
        .base_rotation_
        is None
    )


@pytest.mark.parametrize(
    ("turn", "text"),
    [
        (None, "unknown"),
        (np.eye(3), "none: both base frames have the same"),
        (TURN, "[0.000 -1.000"),
    ],
)
def test_the_report_tells_an_unknown_base_rotation_from_none(turn, text, random_spd):
    """Equal frames are stated as such; only a rotation that was not specified is unknown."""
    rng = np.random.default_rng(0)
    adapter = mp.ParallelTransport(base_rotation=turn).fit(
        random_spd(rng, 20, 3), random_spd(rng, 25, 3)
    )
    assert f"Base rotation: {text}" in as_markdown(report_of(adapter))


def test_a_method_is_found_by_name_or_taken_as_it_is():
    named = method_of("parallel-transport", damping=0.02, base_rotation=TURN, random_state=3)
    assert (type(named), named.damping) == (mp.ParallelTransport, 0.02)
    own = mp.RiemannianICP(damping=0.5)
    taken = method_of(own, damping=0.02, base_rotation=np.eye(3))
    assert taken is not own
    assert (taken.damping, taken.base_rotation) == (0.5, None)
    with pytest.raises(InvalidInputError, match="method 'magic'"):
        method_of("magic")
    with pytest.raises(InvalidInputError, match=r"DomainAdapter.*<class"):
        method_of(mp.RiemannianICP)
    with pytest.raises(InvalidInputError, match="base_rotation"):
        method_of(own, base_rotation=TURN)
    assert (
        method_of(mp.RiemannianICP(base_rotation=TURN), base_rotation=TURN).base_rotation
        is not None
    )


def test_the_length_field_of_an_arm_does_not_depend_on_rounding():
    robot = mp.load_arm("panda")
    person = mp.load_arm("rhuman")
    turn = special_ortho_group.rvs(3, random_state=3)
    teacher, student, new = (
        mp.sample_domain(*pair) for pair in ((person, 600, 0), (robot, 1200, 1), (person, 300, 2))
    )
    options = {"damping": 0.01, "n_centers": 80}
    options["projector"] = FeasibleProjector(robot, bank=SeedBank(robot, 2048))
    turned, turned_new = (congruence(turn, points) for points in (teacher, new))
    mounted = mp.LengthField(base_rotation=turn, **options).fit(teacher, student)
    plain = mp.LengthField(**options).fit(turned, student)
    images = (
        mounted.student_side(mounted.transform(new)),
        plain.student_side(plain.transform(turned_new)),
    )
    assert spd.distance(*images).max() <= 1e-6
