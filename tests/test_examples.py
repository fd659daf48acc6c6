"""The physics of the examples holds; `make docs` runs each example and fails where one does."""

import ast
import json
import runpy
from pathlib import Path

import mujoco
import pytest
from numpy.testing import assert_allclose

from maniport.arms import load_arm
from sizes import little_search

FOLDER = Path(__file__).parents[1] / "examples"
EXAMPLES = sorted(FOLDER.glob("*.py"))
OTHER_DATA = "13_other_spd_data.py"
PLACED = "06_place_and_track.py"
PHYSICS = "08_replay_in_mujoco.py"
LINKS = tuple(f"panda_link{i}" for i in range(1, 8))


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda example: example.name)
def test_examples_explain_themselves(example):
    text = example.read_text(encoding="utf-8")
    assert len((ast.get_docstring(ast.parse(text)) or "").splitlines()) >= 3
    assert f"({example.name})" in (FOLDER / "README.md").read_text(encoding="utf-8")


def test_the_physical_panda_is_the_panda():
    panda = load_arm("panda")
    model = runpy.run_path(str(FOLDER / PHYSICS), run_name="physics")["physical_panda"](panda)
    data = mujoco.MjData(model)
    for q in panda.sample(3, 1):
        data.qpos = q
        data.ctrl = q
        data.qvel = 0.0
        mujoco.mj_forward(model, data)
        assert_allclose(data.xpos[1:], panda.point_positions(q, LINKS), atol=1e-12)
        assert_allclose(data.qfrc_actuator, panda.gravity_torques(q), atol=1e-9)
        assert_allclose(data.qacc, 0.0, atol=1e-6)


@pytest.mark.filterwarnings("ignore::maniport.errors.IdentifiabilityWarning")
def test_other_spd_data_are_registered():
    """Without classes of the new session, ICP classifies as well as pyRiemann's rotation with them."""
    pytest.importorskip("pyriemann.transfer")
    accuracy, errors = runpy.run_path(str(FOLDER / OTHER_DATA))["main"]()
    assert accuracy["as it is"] < 0.8
    assert accuracy["RiemannianICP"] >= accuracy["… TLRotate, classes"] - 0.02
    assert accuracy["ScaledTransport"] >= accuracy["TLCenter, TLScale"] - 0.02
    assert max(errors.values()) < 1e-6


def test_the_notebook_runs_from_top_to_bottom(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    notebook = json.loads((FOLDER / "first_steps.ipynb").read_text(encoding="utf-8"))
    names = {}
    with little_search():
        for cell in notebook["cells"]:
            assert not cell.get("outputs"), "the file has no outputs: they would be outdated"
            if cell["cell_type"] == "code":
                exec(compile("".join(cell["source"]), cell["id"], "exec"), names)
    assert (tmp_path / "results-of-notebook" / "report.html").exists()
    assert len(names["result"].arm.capabilities) == 2
