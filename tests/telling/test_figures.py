"""What the figures show, and what they refuse."""

import subprocess
import sys
from importlib.resources import files

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse
from matplotlib.text import Text
from numpy.testing import assert_allclose

from maniport.errors import InvalidInputError, OutputError
from maniport.spd import lengths
from maniport.telling import figures, page
from maniport.telling.facts import Facts
from maniport.telling.figures.style import COLORS
from maniport.telling.roles import ROLES


def texts(figure):
    """Collect all words of a figure."""
    return [text.get_text() for text in figure.findobj(Text)]


def named(panel, color, style):
    """Return the values of the line of that colour and style."""
    return next(x.get_ydata() for x in panel.lines if x.get_color() == color and x.get_linestyle() == style)


@pytest.mark.parametrize(("d", "views"), [(2, 1), (3, 2)])
def test_every_view_has_a_row_of_ellipses_for_each_profile(motion, d, views):
    """Two profiles give nine blue and nine vermilion ellipses a view, and both names stand above."""
    time, profile = motion(d)
    figure = figures.ellipsoids(time, {"person": profile, "robot": 2 * profile})
    panels = [panel for panel in figure.axes if panel.patches]
    assert len(panels) == views
    for panel in panels:
        colors = [patch.get_edgecolor()[:3] for patch in panel.patches]
        assert colors == [to_rgb(COLORS[0])] * 9 + [to_rgb(COLORS[1])] * 9
    assert {"person", "robot", "time [s]"} <= set(texts(figure))


def test_ellipses_are_the_shadows_of_the_ellipsoids(motion):
    """The outline in a view has the half width and half height of the ellipsoid, √M_xx and √M_yy, at one scale."""
    time, profile = motion()
    figure = figures.ellipsoids(time, {"person": profile}, count=5)
    for panel, plane in zip(figure.axes, ([0, 1], [1, 2]), strict=True):
        outline = panel.patches[0]
        assert isinstance(outline, Ellipse)
        corners = outline.get_transform().transform_path(outline.get_path()).vertices
        inverse = panel.transData.inverted().transform(corners)
        extent = np.ptp(inverse, axis=0) / 2
        assert_allclose(extent, np.sqrt(np.diag(profile[0])[plane]), rtol=0.01)
        assert panel.get_aspect() == 1.0


def test_ellipses_of_a_row_do_not_overlap(motion):
    """Neighbours in a row and in a column lie farther apart than the largest semi-axis twice."""
    time, profile = motion()
    figure = figures.ellipsoids(time, {"person": profile, "robot": 3 * profile})
    largest = np.sqrt(3 * np.max([np.diag(x).max() for x in profile]))
    centers = np.array([patch.center for patch in figure.axes[0].patches])
    gaps = np.linalg.norm(centers[:, None] - centers, axis=-1) + 1e9 * np.eye(len(centers))
    assert gaps.min() > 2 * largest


def test_frames_lie_evenly_in_time_and_never_twice(motion):
    """As many frames are drawn as asked for, where there are so many; they include both ends and skip a pause."""
    time, profile = motion()
    panel = figures.ellipsoids(time, {"p": profile}, count=7).axes[-1]
    shown = np.array([float(label.get_text()) for label in panel.get_xticklabels()])
    assert len(panel.patches) == len(shown) == 7
    assert (shown[0], shown[-1]) == (0.0, 5.5)
    steps = np.sort(np.diff(shown))
    assert steps[-1] > 1.5
    assert_allclose(steps[:-1], 0.67, atol=0.1)
    few = figures.ellipsoids(time[:2], {"p": profile[:2]}, count=9)
    assert len(few.axes[0].patches) == 2
    assert len(figures.ellipsoids(time[:1], {"p": profile[:1]}).axes[0].patches) == 1


def test_flat_ellipsoids_can_be_drawn(motion):
    """Singular ellipsoids appear as strokes, and a volume of zero leaves a gap instead of a warning."""
    time, profile = motion()
    flat = profile.copy()
    flat[10:20, 2, :] = flat[10:20, :, 2] = 0.0
    figures.ellipsoids(time, {"p": flat})
    panels = figures.curves(time, {"p": flat}).axes
    assert np.isnan(named(panels[3], COLORS[0], "-")[10:20]).all()
    assert np.isfinite(named(panels[0], COLORS[0], ":")[10:20]).all()


def test_curves_are_the_numbers_of_the_profile(motion):
    """The first panel holds the three semi-axes, the last the condition number, each with a gap where time jumps."""
    time, profile = motion()
    panels = figures.curves(time, {"person": profile, "robot": 2 * profile}).axes
    semi_axes = lengths(profile)
    for column, style in ((2, "-"), (1, "--"), (0, ":")):
        shown = named(panels[0], COLORS[0], style)
        assert np.flatnonzero(np.isnan(shown)).tolist() == [len(time) // 2]
        assert_allclose(shown[~np.isnan(shown)], semi_axes[:, column])
    condition = named(panels[4], COLORS[1], "-")
    assert_allclose(condition[~np.isnan(condition)], (semi_axes[:, 2] / semi_axes[:, 0]) ** 2)


@pytest.mark.parametrize("d", [2, 3])
def test_curves_name_their_units(motion, d):
    """Lengths, volume and time carry units, and another unit replaces the default."""
    time, profile = motion(d)
    words = texts(figures.curves(time, {"person": profile}))
    assert "length\n[m/s per rad/s]" in words
    assert f"[(m/s per rad/s){'⁰¹²³'[d]}]" in words
    assert "time [s]" in words
    assert "length\n[N per N m]" in texts(figures.curves(time, {"person": profile}, unit="N per N m"))


def test_map_shows_every_domain_and_profile(motion):
    """The map has a cloud for each domain, a line for each profile, and a legend that names them all."""
    time, profile = motion()
    domains = {"person": np.concatenate([profile, 1.5 * profile]), "robot": 2 * profile}
    figure = figures.diffusion_map(domains, {"motion": profile, "adapted": 2 * profile}, time=time)
    panel = figure.axes[0]
    assert {len(x.get_offsets()) for x in panel.collections[::2]} == {120, 60}
    assert np.isnan(panel.lines[0].get_xdata()).sum() == 1
    assert {"domain: person", "profile: adapted"} <= set(texts(figure))
    assert len(figures.diffusion_map(domains, {}).axes[0].lines) == 0


def test_map_does_not_depend_on_how_many_dots_are_drawn(motion):
    """Drawing fewer dots, or breaking lines, leaves a profile's line where it was."""
    time, profile = motion()
    whole = figures.diffusion_map({"p": profile}, {"p": profile}).axes[0].lines[0].get_xydata()
    fewer = figures.diffusion_map({"p": profile}, {"p": profile}, time=time, max_dots=10).axes[0].lines[0].get_xydata()
    assert_allclose(fewer[~np.isnan(fewer[:, 0])], whole, rtol=1e-12)


@pytest.mark.parametrize("draw", [figures.ellipsoids, figures.curves], ids=["ellipsoids", "curves"])
@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t, p: (t[:-1], {"a": p}), r"profiles\['a'\] must have shape \(59, d, d\); .*\(60, 3, 3\)"),
        (lambda t, p: (t[::-1], {"a": p}), r"time must increase strictly; found .* at index 1 after 5.5"),
        (lambda t, p: (t[:, None], {"a": p}), r"time must have shape \(n,\) with n ≥ 1; found shape \(60, 1\)"),
        (lambda t, p: (t[:0], {"a": p[:0]}), r"time must have shape \(n,\) with n ≥ 1; found shape \(0,\)"),
        (lambda t, p: (t, {"a": np.where(p == p[7, 0, 0], np.nan, p)}), r"profiles\['a'\] must be finite; found nan"),
        (lambda t, p: (t, {"a": -p}), r"profiles\['a'\]\[0\] is indefinite"),
        (lambda t, p: (t, {"a": np.stack([np.eye(6)] * 60)}), r"profiles\['a'\] must hold 2×2 or 3×3 .* found 6×6"),
        (lambda t, p: (t, {"a": p, "b": p[:, :2, :2]}), r"profiles must have one dimension; found 'a' .* 'b' "),
        (lambda t, p: (t, {}), r"profiles must be a mapping of 1 to 7 names to arrays; found 0"),
        (lambda t, p: (t, p), r"profiles must be a mapping of 1 to 7 names to arrays; found ndarray"),
    ],
)
def test_profiles_that_cannot_be_drawn_are_refused(motion, draw, change, message):
    """Times and profiles that do not fit, are not finite, not ellipsoids or not of drawable size are named."""
    with pytest.raises(InvalidInputError, match=message):
        draw(*change(*motion()))


def test_other_input_that_cannot_be_drawn_is_refused(motion):
    """Ellipsoids that are all zero, domains of several sizes, and a time that does not fit are named."""
    time, profile = motion()
    with pytest.raises(InvalidInputError, match="all are zero"):
        figures.ellipsoids(time, {"p": 0 * profile})
    with pytest.raises(InvalidInputError, match=r"domains\['b'\] must hold 3×3 matrices; found 2×2"):
        figures.diffusion_map({"a": profile, "b": profile[:, :2, :2]}, {})
    with pytest.raises(InvalidInputError, match=r"profiles\['c'\] must hold 60 matrices as time does; found 59"):
        figures.diffusion_map({"a": profile}, {"c": profile[1:]}, time=time)


def test_figures_are_saved_whole(motion, tmp_path):
    """A path with an ending gives one file, one without gives a PNG and an SVG, the same bytes every time."""
    time, profile = motion()
    figure = figures.curves(time, {"p": profile})
    assert figures.save(figure, tmp_path / "a.png") == [tmp_path / "a.png"]
    assert figures.save(figure, tmp_path / "b") == [tmp_path / "b.png", tmp_path / "b.svg"]
    assert (tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG"
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    assert "<svg" in (tmp_path / "b.svg").read_text(encoding="utf-8")
    assert sorted(x.name for x in tmp_path.iterdir()) == ["a.png", "b.png", "b.svg"]


def test_figures_that_cannot_be_saved_leave_nothing_behind(tmp_path):
    """An unknown ending, a missing folder, and a figure that fails half way raise and leave no file."""
    with pytest.raises(InvalidInputError, match=r"path must end in \.png, \.svg, \.pdf.*found 'a\.jpg'"):
        figures.save(Figure(), tmp_path / "a.jpg")
    with pytest.raises(OutputError, match="there is no folder"):
        figures.save(Figure(), tmp_path / "missing" / "a.png")
    broken = Figure()
    broken.text(0.5, 0.5, r"$\unknown{$")
    with pytest.raises(ValueError, match="unknown"):
        figures.save(broken, tmp_path / "a.png")
    assert list(tmp_path.iterdir()) == []


def test_no_window_and_no_global_state():
    """Loading and drawing never imports pyplot, so that figures are freed and need no display."""
    code = (
        "import sys, numpy as np; from maniport.telling import figures;"
        "figures.ellipsoids([0.0, 1.0], {'p': np.stack([np.eye(3)] * 2)}).canvas.draw();"
        "sys.exit('matplotlib.pyplot' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_roles_have_one_colour_everywhere(motion):
    """A role has its colour whatever the order of the names, and the page's style has the same ones, none by itself."""
    time, profile = motion(3, 30)
    names = {"panda": "achieved", "asked": "target", "someone": "person"}
    figure = figures.curves(time, dict.fromkeys([*names, "other"], profile), roles=names)
    colors = {line.get_label(): line.get_color() for line in figure.legends[0].get_lines()}
    assert {name: colors[name] for name in names} == {name: ROLES[role].color for name, role in names.items()}
    assert colors["other"] not in {role.color for role in (ROLES[name] for name in names.values())}
    style = page.as_html(Facts("t")).split("<style>")[1].split("</style>")[0]
    for role in ROLES.values():
        assert f"--{role.name}:{role.color}" in style
        assert f"--{role.name}:{role.dark}" in style
    own = files("maniport.telling.page").joinpath("assets", "page.css").read_text(encoding="utf-8").lower()
    assert not any(role.color.lower() in own for role in list(ROLES.values())[:3])
    with pytest.raises(InvalidInputError, match="unknown role 'robot'"):
        figures.curves(time, {"a": profile}, roles={"a": "robot"})
