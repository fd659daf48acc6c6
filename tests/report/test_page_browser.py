from dataclasses import replace

import numpy as np
import pytest
from pages import page_of

from maniport.report import report_of
from maniport.report.page import as_html, write_page
from maniport.report.page.animation import animation_of, semi_axis_panels
from maniport.report.page.content import Animation, Body, Line, Panel, Stage, kept_rows


@pytest.fixture(scope="module")
def page(motion, tmp_path_factory):
    """A page of a moving arm with ellipsoids and curves, for 5.5 seconds with a pause."""
    time, teacher = motion(3, 60)
    target = 1.5 * teacher
    swing = np.linspace(0, 1, 60)
    arm = np.stack(
        [
            0 * swing,
            0 * swing,
            0.3 + 0 * swing,
            0.4 * np.cos(swing),
            0.4 * np.sin(swing),
            0.4 + 0.2 * swing,
        ]
    )
    skeleton = np.concatenate([np.zeros((60, 1, 3)), arm.T.reshape(60, 2, 3)], axis=1)
    bend = Panel("bend", "rad", (Line("", swing),), limits=(-1.0, 2.0), span=(-1.2, 2.2))
    stages = (
        Stage("person", (Body("person", skeleton, {"person": teacher}),)),
        Stage(
            "robot",
            (Body("robot", skeleton, {"target": target, "achieved": teacher}, skeleton[:, -1]),),
        ),
    )
    animation = Animation(
        time,
        stages,
        {
            "Ellipsoids": semi_axis_panels({"person": teacher, "target": target}, "m"),
            "Joints": (bend,),
        },
        clocks={"robot": 4.0 * time},
    )
    path = tmp_path_factory.mktemp("page") / "report.html"
    path.write_text(page_of(animation=animation, title="A <b>title</b>"), encoding="utf-8")
    return path


@pytest.fixture
def opened(browser, page):
    browser.dress()
    browser.open(page)
    return browser


def test_the_page_is_drawn_without_errors(opened):
    counts = {".stage canvas": 2, ".chart": 4, "input[type=range]": 1, ".mind li": 1}
    assert {
        name: opened.run(f"document.querySelectorAll('{name}').length") for name in counts
    } == counts
    assert opened.run("document.title") == "A <b>title</b>"
    assert opened.run("document.documentElement.dataset.error || null") is None
    assert opened.complaints == []
    assert [request[:5] for request in opened.requests] == ["file:"]
    drawn = opened.run(
        "new Promise(done => requestAnimationFrame(() => { const player = maniport.player; player.show();"
        " done(player.stages.map(({stage}) => { const {gl, canvas} = stage;"
        " const all = new Uint8Array(4 * canvas.width * canvas.height);"
        " gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, all);"
        " return new Set(new Uint32Array(all.buffer)).size; })); }))"
    )
    assert min(drawn) > 50, "more colors than the background has"


@pytest.mark.slow
def test_keys_move_the_time(opened):
    for key, condition in (
        ("ArrowRight", "> 0"),
        ("ArrowLeft", "== 0"),
        ("End", "> 5.4"),
        ("Home", "== 0"),
        (" ", "> 0.2"),
    ):
        opened.press(key)
        opened.wait(f"document.querySelector('.motion').dataset.time {condition}")
        if key == "ArrowRight":
            time = opened.run("document.querySelector('.motion').dataset.time")
            assert float(time) == pytest.approx(4.0 / 59, abs=1e-3)
    opened.press(" ")
    assert opened.run("maniport.player.playing") is False


@pytest.mark.parametrize(("width", "scheme"), [(390, "light"), (1280, "dark")])
def test_the_page_fits_narrow_and_dark_screens(browser, page, width, scheme):
    browser.dress(width=width, height=844, scheme=scheme, touch=width < 500)
    browser.open(page)
    assert browser.run("document.documentElement.scrollWidth") <= width
    background = browser.run("getComputedStyle(document.body).backgroundColor")
    assert (background == "rgb(255, 255, 255)") == (scheme == "light")
    assert browser.complaints == []


@pytest.fixture(scope="module")
def results(small_result, tmp_path_factory):
    path = tmp_path_factory.mktemp("first") / "report.html"
    write_page(path, report_of(small_result), animation_of(small_result))
    return path


@pytest.mark.slow
def test_the_first_screen_has_the_summary(browser, results, small_result):
    browser.dress(1024, 768)
    browser.open(results)
    order = [".summary", ".cards", ".controls input", ".states", ".stages"]
    ends = [
        browser.run(f"document.querySelector('{one}').getBoundingClientRect().bottom")
        for one in order
    ]
    assert ends == sorted(ends)
    assert ends[3] < 768
    statistics = [metric.statistics for metric in report_of(small_result).main_metrics]
    (first, *_) = filter(None, statistics)
    time = first.time_of_maximum - small_result.time[0]
    browser.run("document.querySelector('.card a').click()")
    browser.wait(f"Math.abs(maniport.player.now - {time}) < 1e-5")
    assert browser.complaints == []


NUMBERS = "[...document.querySelectorAll('.arrows text:not([hidden])')].map(one => one.textContent)"
LENGTHS = (
    "[...document.querySelectorAll('.arrows g')].map(one => [one.getAttribute('class'),"
    " one.querySelector('.shaft').getTotalLength()])"
)


def test_arrows_follow_the_time(browser, results, small_result):
    """Numbers are those of the waypoint; arrows on one line are as long as their values, in perspective."""
    browser.dress()
    browser.open(results)
    force, speed = small_result.arm.capabilities
    for row in (0, len(small_result.time) - 1):
        browser.run(
            f"maniport.player.seek(maniport.player.motion.time[{row}]); maniport.player.show()"
        )
        values = [force.person, force.robot, force.position_only]
        expected = [f"{float(f'{each[row]:.3g}'):g} N" for each in values]
        for each in (speed.robot, speed.position_only):
            expected.append(f"{float(f'{each[row]:.3g}'):g} m/s")
        assert sorted(browser.run(NUMBERS)) == sorted(expected)
        lengths = dict(browser.run(LENGTHS))
        for capability in (force, speed):
            solid = lengths[f"arrow arrow-{capability.kind} achieved"]
            dashed = lengths[f"arrow arrow-{capability.kind} reference arrow-dashed"]
            ratio = capability.robot[row] / capability.position_only[row]
            assert solid / dashed == pytest.approx(ratio, rel=0.1)
    assert browser.complaints == []


def test_arrows_are_switched_like_ellipsoids(browser, results):
    browser.dress()
    browser.open(results)
    labels = browser.run(
        "[...document.querySelectorAll('.key.wide label')].map(one => one.innerText.trim())"
    )
    titles = browser.run(
        "[...document.querySelectorAll('.chart h4')].map(one => one.firstChild.data)"
    )
    assert labels[:2] == titles[:2]
    assert labels[2] == "positions only"
    assert len(browser.run(NUMBERS)) == 5
    for number, left in ((0, ["m/s", "m/s"]), (1, []), (2, [])):
        browser.run(f"document.querySelectorAll('.key.wide input')[{number}].focus()")
        browser.press(" ")
        browser.run("maniport.player.show()")
        assert [text.split()[1] for text in browser.run(NUMBERS)] == left
    assert browser.run("maniport.player.playing") is False
    browser.run("document.querySelectorAll('.key.wide input')[0].click(); maniport.player.show()")
    assert len(browser.run(NUMBERS)) == 2, "of the person and of the robot"


def test_the_first_screen_of_a_phone_has_status_and_animation(browser, results):
    """The numbers of the summary follow the views; on a wide screen they precede them."""
    browser.dress(width=390, height=844, touch=True)
    browser.open(results)
    ends = browser.run(
        "['.summary', '.controls', '.states-key', '.stage:first-child .view', '.stage:last-child .view',"
        " '.numbers'].map(one => document.querySelector(one).getBoundingClientRect().bottom)"
    )
    assert ends == sorted(ends)
    assert ends[-2] < 844
    assert browser.complaints == []
    browser.dress(width=1280, height=900)
    browser.open(results)
    assert browser.run("document.querySelector('header .numbers') !== null")


def test_the_legend_has_the_words_of_the_status(browser, results, small_result):
    browser.dress()
    browser.open(results)
    outcome = browser.run("document.querySelector('.summary h2').textContent")
    legend = browser.run(
        "[...document.querySelectorAll('.states-key > li')].map(one => one.innerText)"
    )
    missed = sum(not state.endswith("followed") for state in small_result.arm.motion.status)
    reached = len(small_result.time) - missed
    assert f"{reached} of {len(small_result.time)} waypoints reached" in outcome
    counts = {"reached": reached, "missed": missed}
    expected = [f"{count} {word}:" for word, count in counts.items() if count]
    assert [text.split(":")[0] + ":" for text in legend] == expected


def test_logarithmic_axes_are_marked(browser, results):
    browser.dress()
    browser.open(results)
    marked = browser.run(
        "[...document.querySelectorAll('.chart h4')].map(one => one.textContent)"
        ".filter(title => title.includes('logarithmic'))"
    )
    assert [title.split(" [")[0] for title in marked] == ["Position error"]


@pytest.mark.slow
def test_links_to_a_maximum_open_its_waypoint(browser, small_result, changed, tmp_path):
    """Maxima within a tenth of a second, of which one follows a pause, each have their own waypoint."""
    n = len(small_result.time)
    motion = small_result.arm.motion
    time = 1000.0 + np.where(np.arange(n) < n // 2, 0.0, 7.3) + 0.0334 * np.arange(n)
    peaks = {"distance": n // 2, "position_error": n // 2 + 1, "gap": n // 2 - 1}
    values = {name: np.where(np.arange(n) == row, 2.0, 0.5) for name, row in peaks.items()}
    moved = {"distance": values["distance"], "position_error": values["position_error"]}
    arm = {"gap": values["gap"], "time": time, "fit": replace(small_result.arm.fit, time=time)}
    result = changed(small_result, arm, **moved)
    write_page(tmp_path / "report.html", report_of(result), animation_of(result))
    browser.dress(1024, 768)
    browser.open(tmp_path / "report.html")
    shown = "maniport.player.at(maniport.player.now).join()"
    links = {
        "distance": "document.querySelectorAll('.card a')[0]",
        "position_error": "document.querySelectorAll('.card a')[1]",
        "gap": "[...document.querySelectorAll('tr')].find(row => row.textContent.startsWith("
        "'Distance to the feasible set')).querySelector('a')",
    }
    for name, link in links.items():
        browser.run(f"{link}.click()")
        browser.wait(f"{shown} == '{peaks[name]},0'")
        address = browser.run(f"{link}.hash")
        browser.open(tmp_path / "report.html", address)
        browser.wait(f"{shown} == '{peaks[name]},0'")
    browser.run(
        "[...document.querySelectorAll('.mind a')].find(a => a.closest('li').textContent"
        ".startsWith('The position error')).click()"
    )
    browser.wait(f"{shown} == '{peaks['position_error']},0'")
    assert len(motion.time) == n
    assert browser.complaints == []


def test_a_thinned_page_contains_the_waypoints_of_its_links(small_result):
    """Of a long motion a page has some of the times only; the linked ones are among them."""
    animation = animation_of(small_result)
    n = len(animation.time)
    report = report_of(small_result)
    statistics = [metric.statistics for metric in report.main_metrics if metric.statistics]
    largest_at = statistics[0].time_of_maximum
    row = int(np.abs(animation.time - largest_at).argmin())
    kept = kept_rows(animation.time, 4, report.times)
    assert row in kept
    assert len(kept) < n
    assert f'href="#t={largest_at:.6f}"' in as_html(report, animation)


def test_all_arms_are_drawn_in_one_view(browser, several, tmp_path):
    animation = animation_of(several(2))
    curves = {"Distance": animation.panels["Distance and position error"]}
    (tmp_path / "report.html").write_text(
        page_of(animation=replace(animation, panels=curves)), encoding="utf-8"
    )
    browser.dress()
    browser.open(tmp_path / "report.html")
    assert browser.complaints == []
    first, second, *_ = browser.run(
        "[...document.querySelectorAll('.chart')].map(one => one.getBoundingClientRect())"
        ".map(one => [one.left, one.top])"
    )
    assert first[1] == second[1]
    assert first[0] < second[0]
    browser.dress(width=390, height=844)
    assert browser.run("document.documentElement.scrollWidth") <= 390


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_has_no_violations(browser, results, axe, scheme):
    browser.dress(1280, 900, scheme)
    browser.open(results)
    browser.run("for (const one of document.querySelectorAll('details')) one.open = true")
    browser.run(f"{axe}; null")
    found = browser.run(
        "axe.run(document).then(found => found.violations.map(one => one.id + one.nodes[0].html))"
    )
    assert found == []
