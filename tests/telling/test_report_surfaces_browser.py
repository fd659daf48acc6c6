"""Surfaces of links in a real browser."""

import numpy as np
import pytest
from pages import written

from maniport.telling.page import Body, Motion, Part


@pytest.fixture(scope="module")
def clad(motion, tmp_path_factory):
    """Two arms, one of them a box that stands and one that turns by a right angle about the vertical."""
    corners = np.stack(np.meshgrid(*[[-0.1, 0.1]] * 3, indexing="ij"), -1).reshape(8, 3)
    # in no order: some are seen clockwise from outside
    triangles = [[0, 1, 3], [0, 2, 3], [4, 5, 7], [4, 6, 7], [0, 1, 5], [0, 4, 5], [2, 3, 7], [2, 6, 7], [0, 2, 6]]
    triangles = np.array([*triangles, [0, 4, 6], [1, 3, 7], [1, 5, 7]])
    poses = np.broadcast_to(np.eye(4), (60, 4, 4)).copy()
    angle = np.linspace(0, np.pi / 2, 60)
    poses[:, 0, 0] = poses[:, 1, 1] = np.cos(angle)
    poses[:, 1, 0], poses[:, 0, 1] = np.sin(angle), -np.sin(angle)
    poses[:, 2, 3] = 0.4
    parts = (Part(corners, triangles, np.broadcast_to(np.eye(4), (60, 4, 4))), Part(corners, triangles, poses))
    time, shells = motion(3, 60)
    skeleton = np.broadcast_to([[0.0, 0, 0], [0, 0, 0.4], [0.3, 0, 0.5]], (60, 3, 3))
    person = Body("person", skeleton, {"person": shells})
    robot = Body("robot", skeleton, {"target": 1.5 * shells, "achieved": shells}, parts=parts)
    moving = Motion(time, (person, robot), legend={"target": "target", "achieved": "the robot's"})
    path = tmp_path_factory.mktemp("clad") / "report.html"
    return written(path, moving)


def pixels(browser, stage=1):
    """Colours of a stage as it is drawn now."""
    return np.array(
        browser.run(
            "new Promise(done => requestAnimationFrame(() => { const player = maniport.players[0]; player.show();"
            f" const {{gl, canvas}} = player.stages[{stage}].stage;"
            " const all = new Uint8Array(4 * canvas.width * canvas.height);"
            " gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, all);"
            " done(Array.from(new Uint32Array(all.buffer))); }))"
        )
    )


def test_surfaces_are_drawn_and_can_be_taken_off(browser, clad):
    """With its check mark the robot shows its surface, without it its skeleton; the person has none and stays."""
    browser.dress()
    browser.open(clad)
    surface, person = pixels(browser), pixels(browser, 0)
    browser.run("[...document.querySelectorAll('.key.wide label')].at(-1).click()")
    skeleton = pixels(browser)
    assert (surface != skeleton).mean() > 0.01
    assert (surface != 0).sum() > (skeleton != 0).sum()
    np.testing.assert_array_equal(pixels(browser, 0), person)
    browser.run("[...document.querySelectorAll('.key.wide label')].at(-1).click()")
    np.testing.assert_array_equal(pixels(browser), surface)
    assert browser.complaints == []
    assert browser.run("maniport.players[0].stages[1].stage.gl.getError()") == 0
