"""What every figure keeps so that it can go into a paper as it is."""

import struct
from xml.etree import ElementTree

import matplotlib
import numpy as np
import pytest
from matplotlib._pylab_helpers import Gcf
from matplotlib.collections import Collection
from matplotlib.colors import to_rgb, to_rgba_array
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.text import Text

from maniport.telling import figures
from maniport.telling.figures.style import COLORS, PALE

SVG = "{http://www.w3.org/2000/svg}"
LONG = "a robot with quite a long name"


def arms(motion):
    """Two arms that swing."""
    time, profile = motion()
    hands = np.stack([np.cos(time), np.sin(time), 0.2 * time], axis=-1)
    skeletons = {name: np.stack([0 * hands, k * hands], axis=1) for k, name in enumerate(("person", LONG), start=1)}
    return figures.arms(skeletons, dict.fromkeys(skeletons, profile), note="what is to be minded of them")


def curves(motion):
    """Three profiles, two of which are equal in shape."""
    time, profile = motion(count=300)
    return figures.curves(time, {"person": profile, LONG: 2 * profile, "third": profile[::-1]})


def diffusion_map(motion):
    """Two domains of more than a hundred points and two profiles."""
    time, profile = motion(count=60)
    domains = {"person": np.concatenate([profile, 1.2 * profile[::-1]]), LONG: np.concatenate([2 * profile] * 3)}
    return figures.diffusion_map(domains, {"person": profile, LONG: 2 * profile}, time=time)


def ellipsoid_views(motion):
    """As many ellipsoids as are ever drawn."""
    _, profile = motion()
    return figures.ellipsoid_views(profile, 2 * profile, 1.5 * profile, count=20)


def ellipsoids(motion):
    """Two rows of nine."""
    time, profile = motion()
    return figures.ellipsoids(time, {"person": profile, LONG: 0.3 * profile})


def moved(motion):
    """Seven joints, one of which slides and one of which knows no limits."""
    time, profile = motion(count=300)
    joints = {f"panda_finger_joint{k}": np.sin(time + k) for k in range(7)}
    limits = dict.fromkeys(joints, (-2.9, 2.9)) | {"panda_finger_joint0": (-np.inf, np.inf)}
    error = 0.002 * np.sin(time) ** 2
    return figures.motion(time, profile[:, 0, 0], joints, limits, error, {"panda_finger_joint1": "m"})


def moved_both(motion):
    """Two arms, one of which has more joints."""
    time, profile = motion(count=300)
    joints = {f"panda_finger_joint{k}": np.sin(time + k) for k in range(7)}
    limits = dict.fromkeys(joints, (-2.9, 2.9))
    few = dict(list(joints.items())[:3])
    error = 0.002 * np.sin(time) ** 2
    return figures.motions(time, {
        "left": (profile[:, 0, 0], joints, limits, error, None), "right": (profile[:, 0, 0], few, limits, error, None),
    })  # fmt: skip


def learned(motion):
    """Three demonstrations, one of which is odd, and what is learned of them."""
    time, profile = motion()
    hand = np.stack([np.cos(time), np.sin(time), 0.2 * time], axis=-1)
    demonstrated = time, np.stack([profile, 1.2 * profile, 2 * profile]), np.stack([hand, hand, -hand])
    return figures.learned(demonstrated, (time, 1.3 * profile, hand), np.full((len(time), 3), 0.1), odd=2)


DRAWN = {
    "arms": arms, "curves": curves, "diffusion_map": diffusion_map, "ellipsoid_views": ellipsoid_views,
    "ellipsoids": ellipsoids, "learned": learned, "motion": moved, "motions": moved_both,
}  # fmt: skip


@pytest.fixture(scope="module", params=DRAWN)
def figure(request, motion):
    """Each of the figures."""
    drawn = DRAWN[request.param](motion)
    drawn.draw_without_rendering()
    return drawn


@pytest.fixture(scope="module")
def files(figure, tmp_path_factory):
    """The figure's two files."""
    return figures.save(figure, tmp_path_factory.mktemp("figure") / "figure")


def seen(figure, kind):
    """Collect the artists of a kind that are not hidden."""
    return [artist for artist in figure.findobj(kind) if artist.get_visible()]


def is_of_the_palette(color):
    """Whether it is a grey, one of our colours, or one of them in the shade that a surface in space has."""
    if np.ptp(color) < 0.02:
        return True
    known = np.array([to_rgb(name) for name in (*COLORS, *PALE) if np.any(to_rgb(name))])
    shades = np.clip(known @ color / np.einsum("ij,ij->i", known, known), 0.0, 1.0)[:, None] * known
    return bool((np.abs(shades - color).max(axis=1) < 0.02).any())


def test_all_public_figures_are_here():
    """A new figure must be added to this file."""
    assert set(DRAWN) == set(figures.__all__) - {"save"}


def columns(figure):
    """How many columns of a paper a figure is wide, by its panels: two arms stand side by side over the whole page."""
    lefts = {round(axes.get_position().x0, 2) for axes in figure.axes}
    return 2 if figure.get_figwidth() == 7.0 and len(lefts) == 2 else 1


def test_as_wide_as_columns_and_nothing_is_cut_off(figure):
    """The figure is 3.5 inches wide for each column, no higher than a page, and everything drawn lies within it."""
    width, height = figure.get_size_inches()
    assert width == 3.5 * columns(figure)
    assert height < 9.0
    box = figure.get_tightbbox()
    assert min(box.x0, box.y0) > -0.005
    assert box.x1 < width + 0.005
    assert box.y1 < height + 0.005


def test_letters_can_be_read(figure):
    """No letter is smaller than 6 pt; formulas, whose indices would be, are not used."""
    written = [text for text in seen(figure, Text) if text.get_text()]
    assert len(written) > 5
    assert min(text.get_fontsize() for text in written) >= 6.0
    assert not [text.get_text() for text in written if "$" in text.get_text()]


def test_colors_are_of_the_palette(figure):
    """Lines, faces, edges and letters are grey or have colours that the colour-blind can tell apart."""
    colors = [line.get_color() for line in seen(figure, Line2D)] + [text.get_color() for text in seen(figure, Text)]
    for patch in seen(figure, Patch):
        colors += [patch.get_facecolor(), patch.get_edgecolor()]
    for collection in seen(figure, Collection):
        colors += [*collection.get_facecolor(), *collection.get_edgecolor()]
    shown = np.concatenate([to_rgba_array(color) for color in colors])
    shown = np.unique(shown[shown[:, 3] > 0, :3].round(4), axis=0)
    assert [color for color in shown if not is_of_the_palette(color)] == []
    assert any(np.ptp(color) > 0.2 for color in shown)


def test_lines_of_one_panel_differ_in_grey(motion):
    """No two lines of a panel that may lie on one another have both width and style in common."""
    for panel in curves(motion).axes:
        looks = [(line.get_linewidth(), line.get_linestyle()) for line in panel.lines]
        assert len(set(looks)) == len(looks)
    panel = diffusion_map(motion).axes[0]
    paths = [line for line in panel.lines if len(line.get_xdata()) > 1 and line.get_color() != "white"]
    assert len({line.get_linewidth() for line in paths}) == len(paths) == 2
    for one in (ellipsoids, ellipsoid_views):
        fills = {patch.get_facecolor() for patch in one(motion).axes[0].patches if patch.get_facecolor()[3] > 0}
        assert len({round(float(fill[3]), 3) for fill in fills}) == len(fills) == 2


def test_no_window_knows_of_it(figure):
    """Neither drawing nor saving registers a figure with pyplot."""
    assert figure.canvas.manager is None
    assert Gcf.figs == {}


def test_files_have_the_width_of_the_column(figure, files):
    """The PNG has 300 pixels an inch; the SVG is XML, as wide in points as it should be, and of reasonable size."""
    picture, drawing = files
    height = figure.get_figheight()
    pixels = struct.unpack(">II", picture.read_bytes()[16:24])
    wide = columns(figure)
    assert pixels == (1050 * wide, int(300 * height))
    page = ElementTree.parse(drawing).getroot()
    assert page.tag == f"{SVG}svg"
    assert page.get("width") == f"{252 * wide}pt"
    assert float(page.get("height").removesuffix("pt")) == pytest.approx(72 * height, abs=0.01)
    assert drawing.stat().st_size < 500_000


def test_letters_stay_letters_and_crowds_become_pixels(figure, files):
    """The SVG holds the words as text; dots and surfaces by the hundred are one picture each, lines are not."""
    page = ElementTree.parse(files[1]).getroot()
    words = {"".join(text.itertext()) for text in page.iter(f"{SVG}text")}
    lines = {line for text in seen(figure, Text) for line in text.get_text().splitlines() if line.strip()}
    assert len(words & lines) >= 5
    crowded = [artist for artist in seen(figure, Collection) if len(artist.get_paths()) > 100]
    dotted = [artist for artist in seen(figure, Collection) if len(artist.get_offsets()) > 100]
    pictures = len(list(page.iter(f"{SVG}image")))
    assert (pictures > 0) == bool(crowded or dotted)
    assert len(list(page.iter(f"{SVG}path"))) < 400


def test_same_figure_gives_the_same_bytes(motion, figure, files, request, tmp_path):
    """Drawn again and saved again, in whichever order and under whichever settings, it gives the same files."""
    name = request.node.callspec.params["figure"]
    again = DRAWN[name](motion)
    with matplotlib.rc_context({"svg.fonttype": "path", "savefig.bbox": "tight", "savefig.dpi": 50}):
        svg, png = (figures.save(again, tmp_path / f"again{ending}")[0] for ending in (".svg", ".png"))
    assert [png.read_bytes(), svg.read_bytes()] == [path.read_bytes() for path in files]
