"""The report in a real browser."""

import numpy as np
import pytest
from pages import written

from maniport.telling.page import (
    Body,
    Line,
    Motion,
    Panel,
    domain_map,
    ellipsoid_panels,
)
from maniport.telling.page.encoding import MAX_FRAMES


@pytest.fixture(scope="module")
def shown(motion):
    """A moving arm with ellipsoids, curves and a map, for 5.5 seconds with a pause."""
    time, teacher = motion(3, 60)
    wanted = 1.5 * teacher
    swing = np.linspace(0, 1, 60)
    arm = np.stack([0 * swing, 0 * swing, 0.3 + 0 * swing, 0.4 * np.cos(swing), 0.4 * np.sin(swing), 0.4 + 0.2 * swing])
    skeleton = np.concatenate([np.zeros((60, 1, 3)), arm.T.reshape(60, 2, 3)], axis=1)
    clouds = {"person": ("person", teacher[::3]), "achieved": ("robot", 2.0 * teacher[::3])}
    lines = {"person": ("person", teacher), "target": ("target", wanted)}
    names = {"person": "person", "target": "target"}
    bend = Panel("bend", "rad", (Line("", swing),), limits=(-1.0, 2.0), span=(-1.2, 2.2))
    return Motion(
        time,
        (
            Body("person", skeleton, {"person": teacher}),
            Body("robot", skeleton, {"target": wanted, "achieved": teacher}, skeleton[:, -1]),
        ),
        {"Ellipsoids": ellipsoid_panels({"person": teacher, "target": wanted}, names, "m"), "Joints": (bend,)},
        domain_map(clouds, lines),
        legend={"person": "the person's", "target": "target", "achieved": "the robot's"},
        clocks={"robot": 4.0 * time},
    )


@pytest.fixture(scope="module")
def page(shown, tmp_path_factory):
    """A report of it."""
    path = tmp_path_factory.mktemp("page") / "report.html"
    return written(path, shown, warnings=("mind this",), title="A <b>title</b>")


@pytest.fixture
def opened(browser, page):
    """The page in a light window of a laptop, at its first moment; opened anew where another one was seen since."""
    browser.dress()
    if browser.run("location.href") == page.as_uri():
        browser.run("maniport.players[0].seek(0); scrollTo(0, 0)")
    else:
        browser.open(page)
    return browser


def now(browser):
    """Time that the page shows, since the start [s]."""
    return float(browser.run("document.querySelector('.motion').dataset.time"))


def test_page_is_drawn_without_a_complaint(opened):
    """All elements are there, no error is logged, and nothing but the file itself is asked for."""
    counts = {".stage canvas": 2, ".chart": 4, ".map canvas": 3, "input[type=range]": 1, ".mind li": 1, ".marker": 2}
    found = {name: opened.run(f"document.querySelectorAll('{name}').length") for name in counts}
    assert found == counts
    assert opened.run("document.title") == "A <b>title</b>"
    # only below a verdict the title of the first section goes without saying
    assert opened.run("getComputedStyle(document.querySelector('#section-0 > h2')).position") == "static"
    assert opened.run("document.documentElement.dataset.error || null") is None
    assert opened.complaints == []
    assert len(opened.requests) == 1
    assert opened.requests[0].startswith("file:")


def test_data_arrive_as_they_were_given(opened, shown):
    """The page's arrays are the given ones in single precision."""
    script = "Array.from(maniport.players[0].motion.{})"
    np.testing.assert_allclose(opened.run(script.format("time")), shown.time - shown.time[0], rtol=1e-6, atol=1e-7)
    corners = np.array(opened.run(script.format("bodies[1].skeleton.data")))
    np.testing.assert_allclose(corners.reshape(60, 3, 3), shown.bodies[1].skeleton, rtol=1e-6, atol=1e-7)
    assert opened.run("maniport.players[0].motion.gaps") == [29]


def test_principal_axes_are_those_of_numpy(opened, shown):
    """Lengths agree with NumPy's eigenvalues, and axes times lengths give the matrix back; a flat one included."""
    for matrix in (*shown.bodies[0].ellipsoids["person"][::20], np.diag([4.0, 0.0, 1.0]), np.zeros((3, 3))):
        six = matrix[np.triu_indices(3)].tolist()
        found = opened.run(f"maniport.principalAxes({six})")
        values = np.sqrt(np.maximum(np.linalg.eigvalsh(matrix)[::-1], 0.0))
        np.testing.assert_allclose(found["lengths"], values, atol=1e-7)
        axes = np.array(found["axes"]).T
        np.testing.assert_allclose(axes * np.square(found["lengths"]) @ axes.T, matrix, atol=1e-7)
        assert np.linalg.det(axes) == pytest.approx(1.0)


def test_stages_show_more_than_their_background(opened):
    """Both stages hold pixels of many colours: the arms are drawn."""
    drawn = opened.run(
        "new Promise(done => requestAnimationFrame(() => { const player = maniport.players[0]; player.show();"
        " done(player.stages.map(({stage}) => { const {gl, canvas} = stage;"
        " const all = new Uint8Array(4 * canvas.width * canvas.height);"
        " gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, all);"
        " return new Set(new Uint32Array(all.buffer)).size; })); }))"
    )
    assert min(drawn) > 50


def test_lost_graphics_come_back(opened):
    """After the graphics context was lost and given back, the stage draws again."""
    opened.run(
        "window.lost = maniport.players[0].stages[0].stage.gl.getExtension('WEBGL_lose_context'); lost.loseContext()"
    )
    opened.wait("maniport.players[0].stages[0].stage.gl.isContextLost()")
    opened.press("ArrowRight")
    opened.run("lost.restoreContext()")
    opened.wait(
        "!maniport.players[0].stages[0].stage.gl.isContextLost() && maniport.players[0].stages[0].stage.begin()"
    )
    assert opened.run("document.documentElement.dataset.error || null") is None
    assert opened.run("maniport.players[0].stages[0].stage.gl.getError()") == 0


def test_keys_move_the_time(opened):
    """Arrows step from frame to frame, End and Home go to the ends, and space plays until space stops."""
    opened.press("ArrowRight")
    opened.wait("document.querySelector('.motion').dataset.time > 0")
    assert now(opened) == pytest.approx(4.0 / 59, abs=1e-3)
    opened.press("ArrowLeft")
    opened.wait("document.querySelector('.motion').dataset.time == 0")
    opened.press("End")
    opened.wait("document.querySelector('.motion').dataset.time > 5.4")
    opened.press("Home")
    opened.wait("document.querySelector('.motion').dataset.time == 0")
    opened.press(" ")
    opened.wait("document.querySelector('.motion').dataset.time > 0.2")
    opened.press(" ")
    assert opened.run("maniport.players[0].playing") is False


def test_playing_moves_cursors_with_the_clock(opened):
    """The play button starts the clock; the curves' cursors and the map's markers follow, to the end."""
    cursor, marker = "document.querySelector('.cursor').getAttribute('x1')", "document.querySelector('.marker')"
    opened.wait(f"{cursor} !== null")  # drawn for the first time
    before = opened.run(f"[{cursor}, {marker}.style.transform]")
    opened.run("document.querySelector('.play').click()")
    opened.wait("maniport.players[0].now > 0.5")
    after = opened.run(f"[{cursor}, {marker}.style.transform]")
    assert float(after[0]) > float(before[0])
    assert after[1] != before[1]
    opened.run("maniport.players[0].seek(5.45)")
    opened.wait("!maniport.players[0].playing")
    assert now(opened) == pytest.approx(5.5, abs=1e-3)


def test_pointing_at_the_map_shows_the_ellipsoid(opened):
    """The pointer over a profile's point names it, and pressing goes to its time."""
    opened.run("document.querySelector('.field').scrollIntoView({block: 'center'})")
    spot = opened.run(
        "(() => { const chart = maniport.players[0].chart, box = chart.field.getBoundingClientRect(),"
        " p = chart.place(chart.map.profiles[0].coordinates.data, 40); return [box.left + p[0], box.top + p[1]]; })()"
    )
    mouse = {"x": spot[0], "y": spot[1], "button": "left", "clickCount": 1}
    opened.call("Input.dispatchMouseEvent", type="mouseMoved", x=spot[0], y=spot[1])
    opened.wait("maniport.players[0].chart.found")
    assert "semi-axes" in opened.run("document.querySelector('.words').textContent")
    opened.call("Input.dispatchMouseEvent", type="mousePressed", **mouse)
    opened.call("Input.dispatchMouseEvent", type="mouseReleased", **mouse)
    opened.wait("document.querySelector('.motion').dataset.time > 0")


def test_roles_can_be_hidden(opened):
    """Without its check mark a role's curves are not shown."""
    opened.run("document.querySelectorAll('.key.wide input')[1].click()")
    assert opened.run("getComputedStyle(document.querySelector('path.curve.target')).display") == "none"
    assert opened.run("getComputedStyle(document.querySelector('path.curve.person')).display") != "none"
    opened.run("document.querySelectorAll('.key.wide input')[1].click()")
    assert opened.run("getComputedStyle(document.querySelector('path.curve.target')).display") != "none"


def test_page_works_without_webgl(browser, page):
    """Where nothing can be drawn in space the page says so, and curves and clock go on."""
    hide = "HTMLCanvasElement.prototype.getContext = (own => function (kind, ...rest) {"
    hide += (
        " return kind === 'webgl2' ? null : own.call(this, kind, ...rest); })(HTMLCanvasElement.prototype.getContext)"
    )
    script = browser.call("Page.addScriptToEvaluateOnNewDocument", source=hide)["identifier"]
    try:
        browser.dress()
        browser.open(page)
        assert "WebGL" in browser.run("document.querySelector('.stage').textContent")
        browser.press("End")
        browser.wait("document.querySelector('.motion').dataset.time > 5.4")
        assert browser.complaints == []
    finally:
        browser.call("Page.removeScriptToEvaluateOnNewDocument", identifier=script)


def test_fragment_opens_at_a_time_and_plays(browser, page):
    """#t= opens there and #play plays, which those who asked for little motion are spared."""
    browser.dress()
    browser.open(page, "#t=2")
    browser.wait("document.querySelector('.motion').dataset.time == 2")
    browser.open(page, "#play")
    browser.wait("maniport.players[0].now > 0.1")
    browser.dress(motion="reduce")
    browser.open(page, "#play")
    assert browser.run("maniport.players[0].playing") is False


@pytest.mark.parametrize(("width", "scheme"), [(390, "light"), (390, "dark"), (1280, "dark")])
def test_page_fits_narrow_and_dark_screens(browser, page, width, scheme, tmp_path):
    """Nothing is wider than the screen, and the background follows the wish for light or dark."""
    browser.dress(width=width, height=844, scheme=scheme, touch=width < 500)
    browser.open(page)
    assert browser.run("document.documentElement.scrollWidth") <= width
    background = browser.run("getComputedStyle(document.body).backgroundColor")
    assert (background == "rgb(255, 255, 255)") == (scheme == "light")
    browser.picture(tmp_path / "page.png")
    assert (tmp_path / "page.png").stat().st_size > 10_000
    assert browser.complaints == []


def test_one_moment_and_long_motions_can_be_shown(browser, tmp_path):
    """A motion of one moment has nothing to play; a very long one is thinned out, its ends kept."""
    for count in (1, 4000):
        time = 100.0 + np.arange(count) / 10.0
        still = Motion(time, (), {"Joints": (Panel("bend", "rad", (Line("", np.sin(time)),)),)})
        written(tmp_path / "r.html", still)
        browser.dress()
        browser.open(tmp_path / "r.html")
        assert browser.complaints == []
        assert browser.run("maniport.players[0].motion.time.length") == min(count, MAX_FRAMES)
        assert browser.run("document.querySelector('.play').disabled") == (count == 1)
        assert browser.run("maniport.players[0].motion.duration") == pytest.approx((count - 1) / 10.0)
