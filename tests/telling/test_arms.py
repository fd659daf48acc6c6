"""Arms in space with the ellipsoids of their hands."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from maniport.errors import InvalidInputError
from maniport.telling import figures
from maniport.telling.figures.arms import _shell


@pytest.fixture
def pair():
    """Two arms with different numbers of corners, in seven postures."""
    angle = np.linspace(0, 1, 7)
    reach = np.stack([np.cos(angle), np.sin(angle), np.zeros(7)], axis=-1)
    skeletons = {
        "short": np.stack([np.zeros((7, 3)), reach], axis=1),
        "long": np.stack([np.zeros((7, 3)), 0.5 * reach, 1.5 * reach], axis=1),
    }
    return skeletons, {name: np.tile(np.diag([0.04, 0.09, 0.0]), (7, 1, 1)) for name in skeletons}


def test_every_posture_has_a_skeleton_and_an_ellipsoid(pair):
    """Five of seven postures are drawn a panel, first and last among them, each with its corners and one surface."""
    skeletons, ellipsoids = pair
    figure = figures.arms(skeletons, ellipsoids, count=5)
    assert [panel.get_title() for panel in figure.axes] == ["short", "long"]
    for panel, lines in zip(figure.axes, skeletons.values(), strict=True):
        drawn = [np.transpose(line.get_data_3d()) for line in panel.lines]
        assert len(drawn) == len(panel.collections) == 5
        assert_allclose(drawn[0], lines[0])
        assert_allclose(drawn[-1], lines[-1])


def test_all_panels_have_one_scale_and_units(pair):
    """Every axis of every panel has the same length in metres, holds everything, and names its unit."""
    figure = figures.arms(*pair)
    spans = {
        round(float(np.ptp(limits)), 9) for p in figure.axes for limits in (p.get_xlim(), p.get_ylim(), p.get_zlim())
    }
    assert len(spans) == 1
    for panel, lines in zip(figure.axes, pair[0].values(), strict=True):
        limits = np.array([panel.get_xlim(), panel.get_ylim(), panel.get_zlim()])
        assert np.all(limits[:, 0] <= lines.min(axis=(0, 1)))
        assert np.all(limits[:, 1] >= lines.max(axis=(0, 1)))
        assert (panel.get_xlabel(), panel.get_zlabel()) == ("x [m]", "z [m]")


def test_notes_and_many_arms_find_room(pair):
    """A note stands below the scale and makes the figure higher; a fourth arm begins a second row."""
    skeletons, ellipsoids = pair
    plain = figures.arms(skeletons, ellipsoids)
    noted = figures.arms(skeletons, ellipsoids, note="seen from the moon")
    assert noted.texts[-1].get_text().endswith("drawn 0.25 m long\nseen from the moon")
    assert noted.get_figheight() > plain.get_figheight()
    four = [dict(zip("abcd", 2 * list(mapping.values()), strict=True)) for mapping in pair]
    boxes = [panel.get_position(original=True) for panel in figures.arms(*four).axes]
    assert len({round(box.y0, 9) for box in boxes[:3]}) == 1
    assert boxes[3].y1 < boxes[0].y0


def test_surface_lies_on_the_ellipsoid():
    """Every point x of the surface has (x − c)ᵀ M⁻¹ (x − c) equal to the square of the drawing's scale."""
    root = np.array([[1.0, 0.2, 0.0], [0.1, 0.7, 0.3], [0.0, -0.2, 0.5]])
    matrix, center = root @ root.T, np.array([1.0, 2.0, 3.0])
    away = _shell(center, matrix, 0.25).reshape(3, -1).T - center
    assert_allclose(np.einsum("ki,ij,kj->k", away, np.linalg.inv(matrix), away), 0.25**2, rtol=1e-10)


def test_wrong_input_is_refused(pair):
    """Missing names, other counts and flat polylines are named in the message."""
    skeletons, ellipsoids = pair
    with pytest.raises(InvalidInputError, match="'long' is missing"):
        figures.arms(skeletons, {"short": ellipsoids["short"]})
    with pytest.raises(InvalidInputError, match=r"ellipsoids\['short'\] must have shape \(7, 3, 3\)"):
        figures.arms(skeletons, {name: points[:3] for name, points in ellipsoids.items()})
    with pytest.raises(InvalidInputError, match=r"skeletons\['short'\] must have shape"):
        figures.arms({"short": np.zeros((7, 3))}, ellipsoids)
    with pytest.raises(InvalidInputError, match="size must be a number above 0"):
        figures.arms(skeletons, ellipsoids, size=0.0)
