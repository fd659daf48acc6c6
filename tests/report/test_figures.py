"""Figures: what they draw, how they are saved, and those of a saved result."""

import sys
from itertools import pairwise

import numpy as np
import pytest
from matplotlib.figure import Figure

import maniport as mp
from maniport.errors import (
    FileFormatError,
    InvalidInputError,
    ManiportError,
    MissingPackageError,
    OutputError,
)
from maniport.report import figures
from maniport.spd.ellipsoid import lengths
from maniport.util.optional import matplotlib


@pytest.mark.parametrize(("d", "views"), [(2, 1), (3, 2)])
def test_every_view_has_a_row_of_ellipses_for_each_profile(motion, d, views):
    time, profile = motion(d)
    figure = figures.ellipsoids(time, {"person": profile, "robot": 2 * profile})
    assert len(figure.axes) == views
    for panel in figure.axes:
        assert len(panel.patches) == 18
        assert len({round(patch.center[1], 6) for patch in panel.patches}) == 2
    extents = [
        path.get_extents()
        for path in (
            p.get_path().transformed(p.get_patch_transform()) for p in figure.axes[0].patches[:9]
        )
    ]
    assert 0.5 * extents[0].width == pytest.approx(np.sqrt(profile[0, 0, 0]), rel=1e-2)
    assert all(one.x1 < other.x0 for one, other in pairwise(extents))


def test_curves_are_the_numbers_of_the_profile(motion):
    time, profile = motion()
    figure = figures.curves(time, {"person": profile, "target": 2 * profile}, unit="N")
    values = figure.axes[0].lines[0].get_ydata()
    np.testing.assert_allclose(values[np.isfinite(values)], lengths(profile)[:, -1])
    assert np.flatnonzero(np.isnan(values)).tolist() == [len(time) // 2]
    assert figure.axes[0].get_title(loc="left") == "Longest semi-axis [N]"
    with pytest.raises(InvalidInputError):
        figures.curves(time, {"robot": profile})


def test_arms_have_one_scale_and_share_a_panel(motion):
    _, profile = motion(count=8)
    line = np.cumsum(np.full((8, 4, 3), 0.1), axis=1)
    skeletons = {"left": line, "right": -line, "other": 0.5 * line}
    figure = figures.arms(
        skeletons, dict.fromkeys(skeletons, profile), count=2, within={"left": "x", "right": "x"}
    )
    assert [panel.get_title() for panel in figure.axes] == ["x", "other"]
    assert [len(panel.lines) for panel in figure.axes] == [4, 2]
    assert len({round(float(np.ptp(panel.get_xlim())), 9) for panel in figure.axes}) == 1


def test_figures_are_saved_whole_and_alike(tmp_path, monkeypatch):
    figure = Figure(figsize=(1.0, 1.0))
    figure.subplots().plot([0, 1], [0, 1])
    first, again = (figures.save(figure, tmp_path / name) for name in ("a", "b"))
    assert [file.suffix for file in first] == [".png", ".svg"]
    assert [file.read_bytes() for file in first] == [file.read_bytes() for file in again]
    with pytest.raises(OutputError):
        figures.save(figure, tmp_path / "missing" / "a.png")
    with pytest.raises(InvalidInputError):
        figures.save(figure, tmp_path / "a.jpg")
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MissingPackageError, match="figures"):
        matplotlib()


@pytest.mark.slow
def test_the_figures_of_a_saved_result(small_result, tmp_path):
    with pytest.raises(ManiportError):
        mp.write_figures(tmp_path)
    (tmp_path / "report.html").write_text("<html></html>")
    with pytest.raises(FileFormatError):
        mp.write_figures(tmp_path)
    mp.write_results(small_result, tmp_path / "out")
    assert not list((tmp_path / "out").glob("*.png"))
    files = mp.write_figures(tmp_path / "out")
    assert {file.stem for file in files} == {"arms", "ellipsoids", "curves", "motion"}
    assert all(file.stat().st_size > 10_000 for file in files)
    with pytest.raises(OutputError):
        mp.write_results(small_result, tmp_path / "out")
    mp.write_results(small_result, tmp_path / "out", overwrite=True)
