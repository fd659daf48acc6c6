import numpy as np
from sklearn.base import clone

import maniport as mp
from sizes import motion_alone


def test_objects_are_displayed(small_result):
    arm = small_result.arm
    for thing, word in (
        (arm.robot, "panda_joint7"), (small_result.recording, "Frames: "), (arm.fit, "Segments: "),
        (arm.adapter, "Rotation: "), (arm.placement, "Path: scale"), (arm.motion, "Ellipsoid distance"),
        (motion_alone(small_result), "Settings"), (small_result, "Position error [mm]"),
        (arm.evaluation, "Comparison with baselines"),
    ):  # fmt: skip
        shown = thing._repr_mimebundle_()
        assert shown["text/plain"] == repr(thing)
        assert word in shown["text/markdown"]
        assert "nan" not in shown["text/markdown"]
        assert len(shown["text/markdown"]) < 28_000


def test_texts_are_escaped():
    names, notes = ("<script>alert(1)</script>",), ("a & b",)
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
