import numpy as np
import pytest

import maniport as mp
from maniport.errors import FileFormatError, InvalidInputError, UnknownNameError
from maniport.pipeline.config import Config
from maniport.pipeline.options import OPTIONS


def test_a_saved_configuration_is_equal_when_loaded(tmp_path):
    config = Config().changed(
        recording="freeform",
        position_tolerance=0.01,
        orientation=[0, 0, -1],
        lock={"lift": 0.2},
        smooth="off",
        workspace=[[0.2, None], [0, 1], [-np.inf, 1]],
        base_rotation=(0.0, 0.1, 1e-7),
        robot=["ur5", "panda"],
        seed=3,
        pose=[(0, 0.3, 0, 0), (0, -0.3, 0, 0)],
        collisions=False,
    )
    config.save(tmp_path / "run.yaml")
    assert Config.load(tmp_path / "run.yaml") == config
    (tmp_path / "empty.yaml").write_text("human: {}")
    assert Config.load(tmp_path / "empty.yaml") == Config()


def test_objects_become_names_in_files(tmp_path):
    config = Config().changed(method=mp.ParallelTransport(), robot=mp.load_arm("panda"))
    config.save(tmp_path / "run.yaml")
    assert Config.load(tmp_path / "run.yaml").method == "parallel-transport"
    assert Config.load(tmp_path / "run.yaml").robot == ("panda",)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("human:\n  persn: myoarm", ("line 2", "persn", "person")),
        ("humn: {}", ("humn", "human")),
        ("motion:\n  move: true\n  rate: 3", ("line 3", "rate", "[10, 10000]")),
        ("motion: {collisions: false, table: 0}", ("table", "no_collisions")),
        ("motion: {costs: [3]}", ("line 1", "costs")),
        ("human: 3", ("line 1", "mapping")),
        ("seed: -1", ("seed",)),
        ("a: &x 1", ("a",)),
        ("motion: [", ("line 1",)),
    ],
)
def test_wrong_files_are_refused(tmp_path, text, words):
    (tmp_path / "run.yaml").write_text(text)
    with pytest.raises(FileFormatError) as caught:
        Config.load(tmp_path / "run.yaml")
    assert all(word in str(caught.value) for word in ("run.yaml", *words))


@pytest.mark.parametrize(
    "options",
    [
        {"position_tolerance": 0.0},
        {"rate": np.inf},
        {"unit": "ft"},
        {"joint_limit_margin": 0.5},
        {"damping": -1.0},
        {"orientation": "up"},
        {"orientation": [0, 0]},
        {"orientation": [0, 0, 0]},
        {"move": "yes"},
        {"n_teacher": 1},
        {"export": ["ros2"], "move": False},
    ],
)
def test_wrong_values_are_refused(options):
    with pytest.raises(InvalidInputError):
        Config().changed(**options)
    with pytest.raises(UnknownNameError, match=r"'positon_tolerance'.*'position_tolerance'"):
        Config().changed(positon_tolerance=0.01)


def test_units_of_elements_are_converted():
    assert OPTIONS["pose"].parse(["0,0.3,0,90"]) == ((0.0, 0.3, 0.0, pytest.approx(np.pi / 2)),)


@pytest.mark.parametrize("option", [{"tilt": "free"}, {"components": 3}, {"pages": True}])
def test_options_of_other_commands_are_refused(option):
    with pytest.raises(UnknownNameError, match=next(iter(option))):
        mp.transfer_recording("freeform", **option)
