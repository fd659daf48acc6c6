"""Stages with several arms."""

from dataclasses import replace

import numpy as np
import pytest
from pages import written

from maniport.report import report_of
from maniport.report.page import as_html
from maniport.report.page.animation import animation_of


@pytest.fixture(scope="module", params=[1, 2, 3])
def shown(request, result, several):
    """The animation of one, two and three arms."""
    return request.param, animation_of(several(request.param))


def test_every_arm_is_drawn(shown, several):
    """Each stage has a body for each arm with its own ellipsoids; panels of arms alternate and name the arm."""
    count, animation = shown
    assert [len(stage.bodies) for stage in animation.stages] == [count, count]
    assert all({"target", "achieved"} == set(body.ellipsoids) for body in animation.stages[1].bodies)
    titles = [panel.title for panel in animation.panels["Distance and position error"]]
    names = ("Left", "Right", "Middle")[:count]
    assert titles[:count] == (
        [f"{name}: ellipsoid distance" for name in names] if count > 1 else ["Ellipsoid distance"]
    )
    joints = [panel.title for panel in animation.panels["Joints of robot"]]
    assert len(joints) == len(set(joints)) == 7 * count
    assert (animation.map is None) == (count > 1)
    page = as_html(report_of(several(count)), {report_of(several(count)).sections[0].key: [animation]})
    assert len(page.encode()) < 6_000_000


def test_surfaces_that_arms_share_are_drawn_once(shown):
    """Copies of one arm have the same surfaces, which the first one draws."""
    count, animation = shown
    parts = [len(body.parts) for body in animation.stages[1].bodies]
    assert parts[0] > 0
    assert parts[1:] == [0] * (count - 1)


def test_all_arms_are_drawn_in_one_view(browser, several, tmp_path):
    """All fit into the view and have ellipsoids of their own; curves of arms are side by side."""
    animation = animation_of(several(2))
    curves = {"Distance": animation.panels["Distance and position error"]}
    browser.dress()
    browser.open(written(tmp_path / "report.html", replace(animation, panels=curves)))
    assert browser.complaints == []
    assert browser.run("document.querySelectorAll('.stage canvas').length") == 2
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
