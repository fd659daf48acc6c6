"""How a robot's motion is planned, on the command line: units, checks before long work, files besides."""

import inspect
import sys
from pathlib import Path

import numpy as np
import pytest

from maniport import cli, load_arm
from maniport.atomic_io import require_free
from maniport.cli.motion import moves
from maniport.errors import OutputError
from maniport.files import save_ellipsoids
from maniport.pipeline import follow
from maniport.telling import write
from maniport.tracking.exports import FORMATS

HOME = "0,-45,0,-135,0,90,45"


class AskedError(Exception):
    """What the library was asked for, instead of the work."""


@pytest.fixture
def track(monkeypatch, capsys, tmp_path):
    """Call `maniport track` with options; return exit code, standard error, and what the library was asked for."""
    save_ellipsoids(tmp_path / "p.npz", np.tile(np.eye(3), (3, 1, 1)), [0.0, 1.0, 2.0])

    def asked(*_, **options):
        raise AskedError(options)

    monkeypatch.setattr(follow, "follow", asked)

    def call(*words):
        words = ("track", tmp_path / "p.npz", "-o", tmp_path / "out", "--quiet", *words)
        monkeypatch.setattr(sys, "argv", ["maniport", *map(str, words)])
        try:
            cli.main()
        except AskedError as found:
            return 0, capsys.readouterr().err, found.args[0]
        except SystemExit as stop:
            return int(stop.code or 0), capsys.readouterr().err, {}
        raise AssertionError("nothing was asked for")

    return call


def test_millimetres_degrees_and_per_cent_become_what_the_library_takes(track):
    """The tip's tolerance is in metres, the home posture in radians, the margin a share of the range."""
    panda = load_arm("panda")
    code, err, asked = track("--tip-tolerance", 12, "--tempo", 0.5, "--margin", 5, "--home", HOME, "--table", 0,
                             "--orientation", "0,0,-1")  # fmt: skip
    assert (code, err) == (0, "")
    assert asked["tip_tolerance"] == pytest.approx(0.012)
    assert asked["tempo"] == 0.5
    assert asked["direction"] == [0.0, 0.0, -1.0]
    np.testing.assert_allclose(asked["home"], np.radians([float(word) for word in HOME.split(",")]))
    np.testing.assert_allclose(
        asked["motion_limits"].lower, panda.lower + 0.05 * (panda.upper - panda.lower), atol=1e-12
    )
    assert "table" in np.array(asked["collisions"].pairs)


def test_options_are_kept_as_they_were_typed():
    """What differs from the defaults can be typed once more; not what only a person or a placed path gives sense."""
    seen = []
    verb = moves(lambda motion: seen.append(motion.typed))
    usual = {name: one.default for name, one in inspect.signature(verb).parameters.items()}
    verb(**usual)
    verb(**usual | {"table": -0.1, "tempo": 0.5, "limits": Path("my limits.yaml"), "collisions": True, "rate": 500.0})
    verb(**usual | {"collisions": False, "orientation": "demonstrated", "export": ["ros2"], "workspace": (0.0,) * 6})
    verb(**usual | {"orientation": "0,0,-1"})
    assert seen == [
        {},
        {"--tempo": "0.5", "--rate": "500", "--limits": "my limits.yaml", "--table": "-0.1"},
        {"--no-collisions": ""},
        {"--orientation": "0,0,-1"},
    ]


@pytest.mark.parametrize(
    ("words", "found"),
    [
        (("--home", "0,-45"), "--home must have 7 numbers, for panda_joint1"),
        (("--home", "0,b"), "--home must be numbers with commas between them"),
        (("--home", "0,-100,0,-135,0,90,45"), r"--home: panda_joint2 is -100°; allowed are -96.96° to 96.96°"),
        (("--home", "0,60,0,-160,0,5,0"), "home: in this posture panda_link0 and panda_link6"),
        (("--table", 0.3), "table: the plane at z = 0.3 m goes through the robot's base"),
        (("--table", 0, "--no-collisions"), "--table says what to keep apart from"),
        (("--margin", 50), "--margin [%] must be a number in [0, 40]; found 50"),
        (("--tip-tolerance", 0), "--tip-tolerance [mm] must be a number above 0; found 0"),
        (("--export", "ros"), "unknown export 'ros'; there are, nearest first: 'ros2'"),
        (("--limits", "nothing.yaml"), "nothing.yaml: there is no such file"),
        (("--srdf", "nothing.srdf"), "nothing.srdf"),
        (("--orientation", "demonstrated"), "--orientation: a profile holds no hand; give free or a direction"),
        (("--orientation", "0,down"), "--orientation: a direction is three numbers such as 0,0,-1; found '0,down'"),
        (("--orientation", "0,0,-1", "--keep", "whole"), "keep must be 'pointing'; found 'whole'"),
        (("--orientation", "0,0"), "direction must be 3 numbers"),
        (("--workspace", 0.5, 0.2, 0, 1, 0, 1), "workspace[0][1] must be a number above 0.5; found 0.2"),
        (("--keep", "some"), "unknown keep 'some'"),
        (("--acceleration-limit", 3), "No such option: --acceleration-limit"),
    ],
)
def test_wrong_options_end_with_one_sentence_before_any_work(track, words, found):
    """The message says what, where, what was found and what is allowed, in the units of the command line."""
    code, err, _ = track(*words)
    assert code == 2
    assert found in err
    assert "╭" not in err


def test_unknown_joints_of_a_limits_file_are_named(track, tmp_path):
    """The file, the joint, and the joints that there are."""
    (tmp_path / "limits.yaml").write_text("joints: {joint1: {velocity: 1}}")
    code, err, _ = track("--limits", tmp_path / "limits.yaml")
    assert code == 2
    assert "limits.yaml: joints of 'panda': unknown key 'joint1'; allowed are, nearest first: panda_joint1" in err


def test_exports_are_written_beside_and_replaced_with_the_folder(small_result, monkeypatch, tmp_path):
    """Each format has its file, and a folder with all of them counts as one of ours."""
    monkeypatch.setattr(write._Shown, "work", lambda self: [])
    folder = tmp_path / "out"
    write.write_results(small_result.execution, folder, exports=FORMATS)
    assert {one.file for one in FORMATS.values()} == set(write.EXPORTS)
    assert set(write.EXPORTS) - {FORMATS[write.SCENE].file} <= {file.name for file in folder.iterdir()}
    require_free(folder, write.EXECUTION_FILES, overwrite=True)
    with pytest.raises(OutputError, match="holds an earlier result"):
        require_free(folder, write.EXECUTION_FILES)
    write.write_results(small_result.execution, tmp_path / "one", exports="ros2")
    assert (tmp_path / "one" / "joints.yaml").is_file()


def test_a_missing_package_is_told_before_any_work(track, monkeypatch):
    """Of each format that needs one: what needs it, and the line that installs it."""
    for name, package in (("mcap", "mcap.writer"), ("parquet", "pyarrow.parquet"), ("rerun", "rerun")):
        monkeypatch.setitem(sys.modules, package, None)
        code, err, _ = track("--export", name)
        assert code == 2
        assert f"the format '{name}' needs {package}" in err
        assert f'pip install "maniport[{name}]"' in err


def test_help_names_every_format_and_its_file(capsys, monkeypatch):
    """What --export says is the table of formats."""
    monkeypatch.setattr(sys, "argv", ["maniport", "track", "--help"])
    with pytest.raises(SystemExit):
        cli.main()
    told = " ".join(capsys.readouterr().out.replace("│", "").split())
    assert "(joints_mujoco.npz)" in told
    assert all(f"{name} ({file})" in told for name, file in zip(FORMATS, write.EXPORTS, strict=True))


def test_long_help_is_in_panels(capsys, monkeypatch):
    """The options of the motion stand together, under what they are about."""
    monkeypatch.setattr(sys, "argv", ["maniport", "transfer", "--help"])
    with pytest.raises(SystemExit):
        cli.main()
    out = capsys.readouterr().out
    places = [
        out.index(f" {word} ") for word in ("How the robot moves", "--tip-tolerance", "What it is kept apart from")
    ]
    assert places == sorted(places)
