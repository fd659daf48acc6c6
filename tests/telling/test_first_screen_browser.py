"""The page of a result in a real browser: what is seen first, and that mouse, keyboard and printer find their way."""

import base64
import csv
import io
import re

import pytest

from maniport.telling import facts_of
from maniport.telling.page import Picture, write_page
from maniport.telling.page.motions import motion_of

TIME = "Number(document.querySelector('.motion').dataset.time)"
PNG = b"\x89PNG\r\n\x1a\n" + bytes(16)


@pytest.fixture(scope="module")
def page(small_result, tmp_path_factory):
    """The page of the main job on a small scale."""
    path = tmp_path_factory.mktemp("first") / "report.html"
    shown = {"motion": [motion_of(small_result), Picture(PNG, "a figure", still=True)]}
    write_page(path, facts_of(small_result), shown)
    return path


@pytest.fixture
def opened(browser, page):
    """The page as it is in a window of a laptop; opened anew where another one was seen since."""
    browser.dress(1024, 768)
    if browser.run("location.href.split('#')[0]") != page.as_uri():
        browser.open(page)
    browser.run("scrollTo(0, 0)")
    return browser


def bottom(browser, selector):
    """Where an element ends on the screen [px]."""
    return browser.run(f"document.querySelector('{selector}').getBoundingClientRect().bottom")


def test_the_first_screen_answers(opened):
    """Verdict, cards, slider and strip stand in this order, and the robot's ellipsoid is seen without scrolling."""
    order = [".verdict", ".cards", ".controls input", ".states", ".stages"]
    ends = [bottom(opened, selector) for selector in order]
    assert ends == sorted(ends)
    assert opened.run("document.querySelectorAll('.card').length") == 4
    hand = opened.run(
        "(() => { const player = maniport.players[0]; player.show(); const { stage, body } = player.stages[1];"
        " const k = player.at(player.now)[0], n = body.skeleton.shape[1];"
        " const tip = [...body.skeleton.data.subarray(3 * n * (k + 1) - 3, 3 * n * (k + 1))];"
        " return stage.canvas.getBoundingClientRect().top + stage.onCanvas(tip)[1]; })()"
    )
    assert hand < 768
    opened.dress(390, 844, touch=True)
    assert bottom(opened, ".verdict") < 844


@pytest.mark.parametrize("width", [1440, 1280, 1024, 390])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_nothing_is_clipped(opened, width, scheme):
    """Neither the page nor a card, a key, a head of a chart or the bar of time is wider than its place."""
    opened.dress(width, 844, scheme)
    assert opened.run("document.documentElement.scrollWidth") <= width
    boxes = ".card, .key, .head, .controls, .verdict, .joint"
    wide = f"[...document.querySelectorAll('{boxes}')].filter(one => one.scrollWidth > one.clientWidth + 1)"
    assert opened.run(f"{wide}.map(one => one.className + ': ' + one.textContent)") == []


def test_the_page_opens_at_a_usual_moment_and_moments_are_links(opened, small_result):
    """It opens where the distance is near the median; a link to the largest goes there and names it in the address."""
    found = motion_of(small_result)
    assert opened.run("maniport.players[0].motion.opening") == pytest.approx(found.opening - found.time[0])
    when = re.search(r"at ([\d.]+) s", facts_of(small_result).verdict.cards[0].details[-1])[1]
    opened.run("document.querySelector('.card a').click()")
    opened.wait(f"Math.abs({TIME} - {float(when) - found.time[0]}) < 1e-3")
    assert opened.run("location.hash") == f"#t={when}"


def test_charts_are_read_hidden_and_saved(opened, small_result):
    """Pointing reads the value there, a press on a key hides its line, and files hold what is shown."""
    opened.run("window.chart = maniport.players[0].charts[0]; chart.node.scrollIntoView({block: 'center'})")
    x, y = opened.run(
        "(() => { const b = chart.node.querySelector('.plot').getBoundingClientRect();"
        " return [b.left + b.width / 2, b.top + 20]; })()"
    )
    opened.call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)
    opened.wait("chart.pointed !== null")
    half = int(opened.run("chart.pointed"))
    assert opened.run("chart.readouts[0].textContent") == opened.run(
        f"String(+chart.lines[0].values[{half}].toPrecision(3))"
    )
    opened.run("chart.node.querySelectorAll('.key button')[1].click()")
    assert opened.run("getComputedStyle(chart.paths[1]).display") == "none"
    rows = list(csv.reader(io.StringIO(opened.run("maniport.asCSV(chart)"))))
    assert rows[0] == ["time [s]", "achieved", "feasibility gap"]
    assert [float(row[1]) for row in rows[1:]] == pytest.approx(small_result.execution.motion.distance, rel=1e-5)
    svg = opened.run("maniport.asSVG(chart)")
    assert svg.count("<path transform") == 2
    assert opened.run(
        "new DOMParser().parseFromString(maniport.asSVG(chart), 'image/svg+xml').querySelector('parsererror') === null"
    )
    opened.run("chart.node.querySelectorAll('.key button')[1].click()")


def test_keys_move_charts_map_and_strips(opened):
    """On a chart and on the map arrows move the time, on the map up and down choose a line; a joint's strip opens."""
    opened.run("maniport.players[0].seek(0)")
    opened.wait(f"{TIME} === 0")
    opened.run("document.querySelector('.plot').focus()")
    opened.press("ArrowRight")
    opened.wait(f"{TIME} > 0")
    opened.run("document.querySelector('.field').focus()")
    opened.press("ArrowDown")
    assert opened.run("document.querySelector('.words b').textContent") == "person"
    opened.press("ArrowDown")
    assert opened.run("document.querySelector('.words').textContent").count("semi-axes") == 1
    before = opened.run(TIME)
    opened.press("ArrowRight")
    opened.wait(f"{TIME} > {before}")
    opened.run("document.querySelector('.strips summary').click()")
    opened.wait("document.querySelector('.strips details[open] .plot') !== null")


def test_before_and_after(opened):
    """A press shows the person's own ellipsoid, turned with the path, in place of the target; another the target."""
    shown = (
        "new Promise(done => requestAnimationFrame(() => { const player = maniport.players[0]; player.show();"
        " const { gl, canvas } = player.stages[1].stage, all = new Uint8Array(4 * canvas.width * canvas.height);"
        " gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, all);"
        " done(all.reduce((sum, x, k) => (sum * 31 + x * (k % 97)) % 1000003, 7)); }))"
    )
    press = "[...document.querySelectorAll('.views button')].at(-1).click()"
    target = opened.run(shown)
    opened.run(press)
    assert opened.run(shown) != target
    opened.run(press)
    assert opened.run(shown) == target


def test_the_page_is_printed_on_few_pages(opened):
    """At most six, with all that is folded; the scene is a picture meanwhile, and is there again afterwards."""
    pdf = base64.b64decode(opened.call("Page.printToPDF", printBackground=True)["data"])
    assert 1 < len(re.findall(rb"/Type\s*/Page\b", pdf)) <= 6
    assert opened.run("document.querySelectorAll('.view img, details.folded[open]').length") == 0
    paper = "getComputedStyle(document.body).backgroundColor"
    opened.dress(1024, 768, "dark")
    dark = opened.run(paper)
    opened.run("dispatchEvent(new Event('beforeprint'))")
    assert opened.run(paper) == "rgb(255, 255, 255)"
    assert opened.run("document.querySelectorAll('.view img').length") == 2
    assert opened.run("document.querySelectorAll('details.folded:not([open])').length") == 0
    opened.run("dispatchEvent(new Event('afterprint'))")
    assert opened.run(paper) == dark
    assert opened.errors == []


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_nothing(opened, axe, scheme):
    """Nothing that axe-core knows of keeps anybody from using the page, all of it open."""
    opened.dress(1280, 900, scheme)
    opened.run("for (const one of document.querySelectorAll('details')) one.open = true")
    opened.run(f"{axe}; null")
    found = opened.run("axe.run(document).then(found => found.violations.map(one => one.id + ' ' + one.nodes[0].html))")
    opened.run("for (const one of document.querySelectorAll('details')) one.open = false")
    assert found == []


def test_without_scripts_the_figures_are_there(browser, page):
    """Where scripts do not run, pictures stand for what moves."""
    browser.dress(1024, 768)
    browser.call("Emulation.setScriptExecutionDisabled", value=True)
    try:
        browser.go(page.as_uri())
        browser.wait("document.readyState === 'complete' && document.images.length === 1")
    finally:
        browser.call("Emulation.setScriptExecutionDisabled", value=False)
