"""Ellipsoids before and after the transfer, over the truth."""

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.text import Text
from numpy.testing import assert_allclose

from maniport.errors import InvalidInputError
from maniport.telling import figures
from maniport.telling.figures.style import COLORS
from maniport.telling.roles import REFERENCE


def outlines(panel, color):
    """Ellipses of a panel in one colour."""
    return [patch for patch in panel.patches if patch.get_edgecolor()[:3] == to_rgb(color)]


def test_both_rows_lie_over_the_truth(motion):
    """From above and from the front there are nine ellipses before, nine after, and the truth under both."""
    _, profile = motion()
    figure = figures.ellipsoid_views(profile, 2 * profile, 3 * profile)
    assert len(figure.axes) == 2
    for panel in figure.axes:
        assert [len(outlines(panel, color)) for color in (*COLORS[:2], REFERENCE.color)] == [9, 9, 18]
    words = {text.get_text() for text in figure.findobj(Text)}
    assert {"teacher", "adapted", "truth", "before", "after", "from above (x right, y up)"} <= words


def test_exact_maps_are_covered_by_the_truth(motion):
    """Where adapted and true ellipsoids are equal, their outlines have the same place, size and angle."""
    _, profile = motion()
    figure = figures.ellipsoid_views(profile, 2 * profile, 2 * profile, count=4)
    for panel in figure.axes:
        for adapted, truth in zip(outlines(panel, COLORS[1]), outlines(panel, REFERENCE.color)[4:], strict=True):
            assert_allclose(truth.get_center(), adapted.get_center())
            assert_allclose((truth.width, truth.height), (adapted.width, adapted.height))
            assert abs(np.sin(np.radians(truth.angle - adapted.angle))) < 1e-9


def test_outlines_have_the_extent_of_the_shadow(motion):
    """Each dashed ellipse is as wide and high as the ellipsoid is, √M_xx and √M_yy in its view."""
    _, profile = motion()
    figure = figures.ellipsoid_views(profile, profile, profile, count=5)
    for panel, plane in zip(figure.axes, ([0, 1], [1, 2]), strict=True):
        outline = outlines(panel, REFERENCE.color)[0]
        corners = outline.get_transform().transform_path(outline.get_path()).vertices
        extent = np.ptp(panel.transData.inverted().transform(corners), axis=0) / 2
        assert_allclose(extent, np.sqrt(np.diag(profile[0])[plane]), rtol=0.01)


def test_wrong_input_is_refused(motion):
    """Sets of unequal numbers, flat matrices, all-zero ones and repeated names are refused."""
    _, profile = motion()
    _, flat = motion(2)
    with pytest.raises(InvalidInputError, match=r"profiles\['adapted'\] must have shape"):
        figures.ellipsoid_views(profile, profile[1:], profile)
    with pytest.raises(InvalidInputError, match="3×3 to be seen from two sides"):
        figures.ellipsoid_views(flat, flat, flat)
    with pytest.raises(InvalidInputError, match="positive size"):
        figures.ellipsoid_views(0 * profile, 0 * profile, 0 * profile)
    with pytest.raises(InvalidInputError, match="three different words"):
        figures.ellipsoid_views(profile, profile, profile, names=("a", "a", "b"))
