"""Pictures that hold two arms, and figures with a column for each."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pages import written

from maniport.report.figures import _decoded
from maniport.report.page import Body, Line, Motion, Panel
from maniport.report.page.content import as_json

COUNT = 12
TIME = np.linspace(0.0, 1.0, COUNT)
SWING = np.stack([0.4 * np.cos(TIME), 0.4 * np.sin(TIME), 0.2 + 0.2 * TIME], axis=-1)


def arm(side, **shown):
    """An arm that stands left (+1) or right (−1) and swings."""
    base = np.broadcast_to([0.0, 0.3 * side, 0.0], (COUNT, 3))
    return Body("arm", np.stack([base, base + 0.5 * SWING, base + SWING * [1, side, 1]], axis=1), **shown)


@pytest.fixture(scope="module")
def pair():
    """A person's and a robot's two arms, in two pictures, and curves of the left and of the right."""
    balls = [np.tile(size * np.eye(3), (COUNT, 1, 1)) for size in (0.2, 0.4, 0.1, 0.3)]
    person = arm(1, ellipsoids={"person": balls[0]}, beside=(arm(-1, ellipsoids={"person": balls[1]}),))
    tips = [arm(side).skeleton[:, -1] for side in (1, -1)]
    robot = Body(
        "robot",
        arm(1).skeleton,
        {"target": balls[2]},
        tips[0],
        turn=np.eye(3),
        beside=(arm(-1, ellipsoids={"target": balls[3]}, path=tips[1]),),
    )
    curves = tuple(Panel(name, "", (Line("", TIME),)) for name in ("Left: way", "Right: way"))
    return Motion(TIME, (person, robot), {"How": curves}, legend={"person": "the person's", "target": "target"})


def test_arms_of_a_pair_are_written_beside_one_another(pair):
    """Every array of the second arm comes back; a body that is alone has no word of others."""
    data = _decoded(json.loads(as_json(pair, 100)))
    for body, shown in zip(data["bodies"], pair.bodies, strict=True):
        (other,) = body["beside"]
        assert_allclose((other["skeleton"]), shown.beside[0].skeleton, rtol=1e-6, atol=1e-7)
        assert "beside" not in other
    assert_allclose((data["bodies"][1]["beside"][0]["path"]), pair.bodies[1].beside[0].path, atol=1e-6)
    alone = json.loads(as_json(Motion(TIME, (arm(1),)), 100))["bodies"][0]
    assert set(alone) == {"name", "skeleton", "ellipsoids", "path", "parts", "turn", "figure"}


def test_both_arms_are_drawn_in_one_picture(browser, pair, tmp_path):
    """Both fit into the picture, have ellipsoids of their own, and curves of left and right stand side by side."""
    browser.dress()
    browser.open(written(tmp_path / "report.html", pair))
    assert browser.complaints == []
    assert browser.run("document.querySelectorAll('.stage canvas').length") == 2
    low, high = (np.array(browser.run(f"maniport.players[0].bounds(maniport.players[0].motion.bodies[0]).{end}"))
                 for end in ("low", "high"))  # fmt: skip
    corners = np.concatenate([one.skeleton.reshape(-1, 3) for one in pair.bodies[0].all])
    assert np.all(low <= corners.min(axis=0) + 1e-6)
    assert np.all(high >= corners.max(axis=0) - 1e-6)
    drawn = browser.run(
        "(() => { const player = maniport.players[0], { stage } = player.stages[1], found = [], own = stage.ellipsoid;"
        " stage.ellipsoid = (place, six, size) => { found.push([...place, six[0]]); };"
        " for (const copying of [false, true]) { player.copying = copying; player.show(); }"
        " stage.ellipsoid = own; return found; })()"
    )
    tips = [one.skeleton[0, -1] for one in pair.bodies[1].all]
    assert_allclose(drawn, [[*tip, size] for sizes in ((0.1, 0.3), (0.2, 0.4))
                            for tip, size in zip(tips, sizes, strict=True)], atol=1e-6)  # fmt: skip
    boxes = browser.run(
        "[...document.querySelectorAll('.chart')].map(one => [one.getBoundingClientRect().left,"
        " one.getBoundingClientRect().top])"
    )
    assert boxes[0][1] == boxes[1][1]
    assert boxes[0][0] < boxes[1][0]
    browser.dress(width=390, height=844)
    assert browser.run("document.documentElement.scrollWidth") <= 390
