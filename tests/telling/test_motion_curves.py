"""The figure of a robot's motion."""

import numpy as np
import pytest

from maniport.errors import InvalidInputError
from maniport.telling import figures

TIME = np.linspace(0.0, 3.0, 40)
JOINTS = {"shoulder": np.sin(TIME), "a_joint_with_a_long_name": np.cos(TIME)}
LIMITS = {"shoulder": (-2.0, 2.0), "a_joint_with_a_long_name": (-np.inf, np.inf)}


def test_each_quantity_has_a_panel():
    """Distance, the hand's error and each joint have a panel with a name and its unit."""
    figure = figures.motion(TIME, TIME / 3, JOINTS, LIMITS, 1e-3 * TIME, {"shoulder": "m"})
    names = [panel.get_title(loc="left") for panel in figure.axes]
    assert len(names) == 4
    assert "[mm]" in names[1]
    assert names[2:] == ["shoulder [m]", "a_joint_with_a_long_name [°]"]
    np.testing.assert_allclose(figure.axes[1].lines[0].get_ydata(), TIME)
    np.testing.assert_allclose(figure.axes[2].lines[0].get_ydata(), np.sin(TIME))
    np.testing.assert_allclose(figure.axes[3].lines[0].get_ydata(), np.degrees(np.cos(TIME)))


def test_without_a_path_there_is_no_panel_for_the_hand():
    """The hand's error is drawn where there is one."""
    assert len(figures.motion(TIME, TIME, JOINTS, LIMITS).axes) == 3


def test_limits_frame_the_joint():
    """The panel of a joint names its limits and shows a little beyond; a joint without limits fills its panel."""
    figure = figures.motion(TIME, TIME, JOINTS, LIMITS | {"shoulder": (-np.pi / 2, np.pi / 2)})
    low, high = figure.axes[1].get_ylim()
    assert low < -90.0 < 90.0 < high
    figure.canvas.draw()
    assert [label.get_text() for label in figure.axes[1].get_yticklabels()] == ["−90", "0", "90"]
    assert len(figure.axes[1].patches) == 2
    assert not figure.axes[2].patches


def test_bad_input_is_said():
    """Other lengths and joints without limits are refused."""
    with pytest.raises(InvalidInputError, match="distance must have shape"):
        figures.motion(TIME, TIME[:-1], JOINTS, LIMITS)
    with pytest.raises(InvalidInputError, match="limits must name every joint"):
        figures.motion(TIME, TIME, JOINTS, {"shoulder": (-1.0, 1.0)})
