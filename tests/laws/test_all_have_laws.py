"""That nothing public is without laws."""

import importlib
import inspect
from pathlib import Path

import pytest

import maniport
from laws import COVERED
from maniport.spd import log_euclidean

ROOMS = ("spd", "transfer", "profiles", "tracking", "evaluation", "demonstrations", "bodies")
METHODS = (
    "bodies.Arm", "bodies.collisions.Collisions", "demonstrations.Recording", "profiles.ProfileGMM",
    "profiles.Alignment", "tracking.StartBank",
)  # fmt: skip
"""Classes whose methods have laws each; other results hold arrays, and methods of transfer are all alike."""
WITHOUT = {
    "bodies.Look": "what an arm looks like: tests/bodies/test_bodies_meshes.py",
    "bodies.Surface": "what an arm looks like: tests/bodies/test_bodies_meshes.py",
    "bodies.Arm.surfaces": "triangles of files: tests/bodies/test_bodies_surfaces.py",
    "bodies.collisions.Collisions.of": "reads shapes: tests/bodies/test_collisions.py",
    "bodies.collisions.Collisions.nearest": "solids of Coal: tests/bodies/test_collisions.py",
    "bodies.collisions.Collisions.gradient": "by finite differences: tests/bodies/test_collisions.py",
    "bodies.Arm.motion": "a part of posed_differentials",
    "bodies.Arms": "block formulas, mirror images: tests/bodies/test_two_arms.py, test_cooperative.py",
    "bodies.load_arms": "reads robots: tests/bodies/test_two_arms.py",
    "bodies.Arm.posed_differentials": "equal to what has laws, bit for bit: tests/bodies",
    "bodies.collisions.Collisions.watch": "answers as Collisions does: tests/bodies/test_collisions.py",
    "bodies.collisions.Collisions.table": "a number that was given",
    "bodies.collisions.Collisions.stand_ins": "names of a file: tests/bodies/test_collisions.py",
    "bodies.collisions.Collisions.unchecked": "names of a file: tests/bodies/test_collisions.py",
    "bodies.collisions.Collisions.between": "a part of a pair's pairs: tests/tracking/test_both_plan.py",
    "bodies.collisions.Collisions.each": "what `of` gives for one arm",
    "batches": "calls what has laws: tests/batches",
    "batches.batch": "calls what has laws: tests/batches",
    "demonstrations.ArmFit": "a result of fit_arm",
    "demonstrations.ArmFits": "a result of fit_arms",
    "demonstrations.fit_arms": "each arm as fit_arm finds it: tests/demonstrations/test_both_arms.py",
    "demonstrations.fit_arm": "takes a recording, which has laws: tests/demonstrations/test_arm_fit.py",
    "demonstrations.shipped_recording": "a path",
    "errors": "words",
    "evaluation.Choice": "a result of choose",
    "evaluation.ElbowBaseline": "an option of evaluate: tests/evaluation/test_elbow.py",
    "evaluation.Evaluation": "a result of evaluate",
    "evaluation.Gaps": "a result of evaluate",
    "evaluation.Row": "a result of evaluate",
    "evaluation.Verdict": "a result of evaluate",
    "evaluation.Weakness": "a result of evaluate",
    "evaluation.choose": "fits and measures by what has laws: tests/evaluation/test_choice.py",
    "evaluation.evaluate": "measures by what has laws: tests/evaluation/test_evaluation_report.py",
    "live": "limits, agreement with the offline fit and the same bytes again: tests/live",
    "live.Live": "limits, agreement with the offline fit and the same bytes again: tests/live",
    "pipeline": "calls what has laws: tests/test_pipeline.py",
    "telling": "says what has been computed: tests/telling",
    "tracking.OfflineControl": "of optimize_trajectory",
    "tracking.OfflineResult": "of optimize_trajectory",
    "tracking.optimize_trajectory": "takes many seconds: tests/tracking/test_offline.py",
    "tracking.StartBank.given_or_built": "not for users",
    "tracking.StartBank.require_fits": "says whether a bank fits: tests/tracking/test_start_bank.py",
    "tracking.StartBank.starts": "query, for searches",
    "tracking.StartBank.starts_for": "query, for searches",
    "tracking.export_motion": "writes files: tests/tracking/test_exports.py",
    "tracking.plan_arms": "its laws take seconds: tests/tracking/test_both_plan.py",
    "tracking.PlannedArms": "see plan_arms",
    "tracking.TrackedArms": "see track_arms",
    "tracking.track_arms": "tests/tracking/test_both_follow.py",
    "tracking.ArmsPlanner": "see plan_arms",
}
"""Public names without laws here, and why."""


def public_names():
    """Functions and classes of the rooms, by their homes, and methods of some classes; tables have no laws."""
    for room in ROOMS:
        module = importlib.import_module(f"maniport.{room}")
        yield from (f"{room}.{name}" for name in module.__all__ if callable(getattr(module, name)))
    for name, function in vars(log_euclidean).items():
        if inspect.isfunction(function) and function.__module__ == log_euclidean.__name__ and name[0] != "_":
            yield f"spd.log_euclidean.{name}"
    for name in METHODS:
        room, _, kind = name.rpartition(".")
        owner = getattr(importlib.import_module(f"maniport.{room}"), kind)
        for method, value in inspect.getmembers(owner):
            code = getattr(value, "fget", getattr(value, "func", value))  # of a property, or of a cached one
            own = inspect.isroutine(code) and str(getattr(code, "__module__", "")).startswith("maniport")
            if own and not method.startswith(("_", "get_", "set_")):
                yield f"{name}.{method}"
    for name in maniport.__all__:
        home = maniport._HOMES.get(name)
        if (
            name not in ROOMS
            and name != "__version__"
            and (home is None or home.split(".")[0] not in ("telling", "pipeline"))
        ):
            yield f"{home}.{name}" if home else name


def test_every_public_name_has_laws():
    """Each public name is covered by a law of this room, or listed with the reason why it is not; no list is stale."""
    for file in Path(__file__).parent.glob("test_*_laws.py"):
        importlib.import_module(f"laws.{file.stem}")
    public = set(public_names()) - {"domain"}
    assert sorted(public - COVERED - set(WITHOUT)) == []
    assert sorted((COVERED | set(WITHOUT)) - public) == []
    assert sorted(COVERED & set(WITHOUT)) == []


@pytest.mark.parametrize("room", ["", *ROOMS])
def test_every_public_name_is_there(room):
    """What the package and its rooms list can be had, and completion shows it; anything else is an AttributeError."""
    module = importlib.import_module(f"maniport.{room}".rstrip("."))
    assert set(module.__all__) <= set(dir(module))
    assert all(hasattr(module, name) for name in module.__all__)
    assert not hasattr(module, "no_such_name")
