import sys

import numpy as np
import pytest
from sklearn.base import clone

import maniport as mp
from sizes import motion_alone


def test_objects_are_displayed(small_result):
    arm = small_result.arm
    for thing, word in (
        (arm.robot, "panda_joint7"),
        (small_result.recording, "Frames: "),
        (arm.fit, "Segments: "),
        (arm.adapter, "Rotation: "),
        (arm.placement, "Path: scale"),
        (arm.motion, "Ellipsoid distance"),
        (motion_alone(small_result), "Settings"),
        (small_result, "Position error [mm]"),
        (arm.evaluation, "Comparison with baselines"),
    ):
        shown = thing._repr_mimebundle_()
        assert shown["text/plain"] == repr(thing)
        assert word in shown["text/markdown"]
        assert "nan" not in shown["text/markdown"]
        assert len(shown["text/markdown"]) < 28_000


def test_texts_are_escaped():
    names = ("<script>alert(1)</script>",)
    notes = ("a & b",)
    recording = mp.Recording(names, np.zeros((2, 1, 3)), np.arange(2.0), notes=notes)
    text = recording._repr_mimebundle_()["text/markdown"]
    assert "\\<script" in text
    assert text.count("<") == text.count("\\<")


def test_the_prompt_of_an_adapter_makes_it_again():
    icp = mp.RiemannianICP(damping=0.01, n_starts=2)
    again = eval(repr(icp), {"RiemannianICP": mp.RiemannianICP})
    assert again.get_params() == icp.get_params()
    assert repr(again) == repr(clone(icp))
    assert "#" not in repr(again)
    assert "not fitted" in again._repr_mimebundle_()["text/markdown"]


def test_objects_are_plotted(small_result):
    arm = small_result.arm
    motion = arm.motion
    for thing, panels in (
        (small_result.recording, 3),
        (arm.robot, 1),
        (arm.fit, 1),
        (motion, 2),
        (small_result.motion, 1),
    ):
        figure = thing.plot()
        assert len(figure.axes) == panels, thing
        assert any(axes.lines or axes.collections for axes in figure.axes)
    titles = [axes.get_title(loc="left") for axes in small_result.plot().axes]
    assert any("Force" in title for title in titles)
    assert any("Ellipsoid distance" in title for title in titles)


def test_the_plotted_distance_is_that_of_the_motion(small_result):
    (line,) = small_result.arm.motion.plot().axes[0].lines
    np.testing.assert_array_equal(line.get_ydata(), small_result.arm.motion.distance)


def test_a_plot_without_matplotlib_names_the_extra(small_result, monkeypatch):
    for name in ("maniport.report.plots", "maniport.report.figures"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    monkeypatch.delattr("maniport.report.figures", raising=False)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(mp.errors.MissingPackageError, match="figures"):
        small_result.plot()
