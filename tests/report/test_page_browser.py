"""The report in a real browser."""

from dataclasses import replace

import numpy as np
import pytest
from pages import map_with, written

from maniport.report import report_of
from maniport.report.page import Animation, Body, Line, Panel, Stage, write_page
from maniport.report.page.animation import animation_of, semi_axis_panels


@pytest.fixture(scope="module")
def shown(motion):
    """A moving arm with ellipsoids, curves and a map, for 5.5 seconds with a pause."""
    time, teacher = motion(3, 60)
    wanted = 1.5 * teacher
    swing = np.linspace(0, 1, 60)
    arm = np.stack([0 * swing, 0 * swing, 0.3 + 0 * swing, 0.4 * np.cos(swing), 0.4 * np.sin(swing), 0.4 + 0.2 * swing])
    skeleton = np.concatenate([np.zeros((60, 1, 3)), arm.T.reshape(60, 2, 3)], axis=1)
    clouds = {"person": teacher[::3], "achieved": 2.0 * teacher[::3]}
    lines = {"person": teacher, "target": wanted}
    bend = Panel("bend", "rad", (Line("", swing),), limits=(-1.0, 2.0), span=(-1.2, 2.2))
    return Animation(
        time,
        (
            Stage("person", (Body("person", skeleton, {"person": teacher}),)),
            Stage("robot", (Body("robot", skeleton, {"target": wanted, "achieved": teacher}, skeleton[:, -1]),)),
        ),
        {"Ellipsoids": semi_axis_panels({"person": teacher, "target": wanted}, "m"), "Joints": (bend,)},
        map_with(clouds, lines),
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
    assert opened.run("document.documentElement.dataset.error || null") is None
    assert opened.complaints == []
    assert len(opened.requests) == 1
    assert opened.requests[0].startswith("file:")
    drawn = opened.run(
        "new Promise(done => requestAnimationFrame(() => { const player = maniport.players[0]; player.show();"
        " done(player.stages.map(({stage}) => { const {gl, canvas} = stage;"
        " const all = new Uint8Array(4 * canvas.width * canvas.height);"
        " gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, all);"
        " return new Set(new Uint32Array(all.buffer)).size; })); }))"
    )
    assert min(drawn) > 50, "more than their background"


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


@pytest.mark.parametrize(("width", "scheme"), [(390, "light"), (1280, "dark")])
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


@pytest.fixture(scope="module")
def results(small_result, tmp_path_factory):
    """The page of the main job on a small scale."""
    path = tmp_path_factory.mktemp("first") / "report.html"
    write_page(path, report_of(small_result), {"motion": [animation_of(small_result)]})
    return path


def test_the_first_screen_answers(browser, results, small_result):
    """Summary, cards, slider and strip are in this order above the fold, and links to times go there."""
    browser.dress(1024, 768)
    browser.open(results)
    order = [".summary", ".cards", ".controls input", ".states", ".stages"]
    ends = [browser.run(f"document.querySelector('{one}').getBoundingClientRect().bottom") for one in order]
    assert ends == sorted(ends)
    assert ends[3] < 768
    found = animation_of(small_result)
    when = report_of(small_result).main_metrics[0].value["max_at_s"]
    browser.run("document.querySelector('.card a').click()")
    browser.wait(f"Math.abs(maniport.players[0].now - {round(when, 1) - found.time[0]}) < 1e-3")
    assert browser.complaints == []


def test_all_arms_are_drawn_in_one_view(browser, several, tmp_path):
    """All fit into the view; curves of arms are side by side."""
    animation = animation_of(several(2))
    curves = {"Distance": animation.panels["Distance and position error"]}
    browser.dress()
    browser.open(written(tmp_path / "report.html", replace(animation, panels=curves)))
    assert browser.complaints == []
    low, high = (np.array(browser.run(f"maniport.players[0].bounds(maniport.players[0].motion.stages[0]).{end}"))
                 for end in ("low", "high"))  # fmt: skip
    corners = np.concatenate([body.skeleton.reshape(-1, 3) for body in animation.stages[0].bodies])
    assert np.all(low <= corners.min(axis=0) + 1e-6)
    assert np.all(high >= corners.max(axis=0) - 1e-6)
    boxes = browser.run(
        "[...document.querySelectorAll('.chart')].map(one => [one.getBoundingClientRect().left,"
        " one.getBoundingClientRect().top])"
    )
    assert boxes[0][1] == boxes[1][1]
    assert boxes[0][0] < boxes[1][0]
    browser.dress(width=390, height=844)
    assert browser.run("document.documentElement.scrollWidth") <= 390


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_nothing(browser, results, axe, scheme):
    """Nothing that axe-core knows of keeps anybody from using the page, all of it open."""
    browser.dress(1280, 900, scheme)
    browser.open(results)
    browser.run("for (const one of document.querySelectorAll('details')) one.open = true")
    browser.run(f"{axe}; null")
    found = browser.run("axe.run(document).then(found => found.violations.map(one => one.id + one.nodes[0].html))")
    assert found == []
