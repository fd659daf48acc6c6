"""Where commands write without --output, and that suggested commands name the folder that was written."""

import html
import json
import re
import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import maniport as mp
from maniport.cli.application import output_folder
from maniport.errors import InvalidInputError
from maniport.report import as_markdown, report_of
from maniport.report.values import Report
from maniport.util.atomic_io import free_path
from maniport.util.files import load_ellipsoids, save_ellipsoids
from sizes import little_search, panda_profile


@pytest.fixture
def small_search():
    with little_search():
        yield


FAST = (
    "--start",
    2,
    "--stop",
    2.3,
    "--n-teacher",
    64,
    "--n-student",
    128,
    "--method",
    "parallel-transport",
)


@pytest.fixture
def profile(tmp_path, monkeypatch):
    """Change to a folder with ellipsoids of a motion; return the name of their file."""
    _, time, _, ellipsoids, _ = panda_profile()
    save_ellipsoids(tmp_path / "my profile.npz", ellipsoids, time)
    monkeypatch.chdir(tmp_path)
    return "my profile.npz"


@pytest.mark.slow
@pytest.mark.usefixtures("small_search")
def test_commands_write_to_a_new_folder_by_default(run, profile, tmp_path):
    """Named after input and robot, numbered where it exists, and printed, also with --quiet and as JSON."""
    for number, flags in (("", ()), ("-2", ("--quiet",)), ("-3", ("--json",))):
        code, out, err = run("track", profile, "--no-collisions", *flags)
        assert code == 0, err
        name = f"maniport-my_profile-panda{number}"
        assert (tmp_path / name / "run.yaml").is_file()
        assert name in out + err
        if flags == ("--json",):
            assert json.loads(out)["output"] == name
    assert len([entry for entry in tmp_path.iterdir() if entry.is_dir()]) == 3


@pytest.mark.slow
@pytest.mark.usefixtures("small_search")
def test_a_transfer_without_output_repeats_by_its_own_command(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, out, err = run("transfer", "freeform", *FAST)
    assert code == 0, err
    folder = tmp_path / "maniport-freeform-panda"
    assert (folder / "joints.csv").is_file()
    assert f"{folder.name}/report.html" in out
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    code, _, err = run("transfer", "--config", folder / "run.yaml", "--quiet")
    assert code == 0, err
    again = tmp_path / "elsewhere" / "maniport-freeform-panda"
    assert (again / "joints.csv").read_bytes() == (folder / "joints.csv").read_bytes()


def test_names_of_default_folders(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for recordings, robots, name in (
        (["a b/wälk (1).bvh"], ["robots/ur5.urdf"], "maniport-wälk_1_-ur5"),
        (["ladder"], ["robosuite/ur5e"], "maniport-ladder-ur5e"),
        (["keypoints/"], ["panda", "panda"], "maniport-keypoints-panda"),
        ([f"{'x' * 200}.c3d"], ["a.xml", "b.xml"], f"maniport-{'x' * 60}-a-b"),
        (["../x.bvh"], [], "maniport-x"),
    ):
        assert output_folder(None, recordings, robots, False) == Path(name)
    assert output_folder(Path("out"), ["a"], ["b"], True) == Path("out")
    with pytest.raises(InvalidInputError, match="--output"):
        output_folder(None, ["a"], ["b"], True)


def test_a_free_path_is_followed_by_free_suffixes(tmp_path):
    (tmp_path / "a-robot").mkdir()
    (tmp_path / "a-2").symlink_to("nowhere")
    assert free_path(tmp_path / "a", "-robot") == tmp_path / "a-3"
    assert free_path(tmp_path / "b") == tmp_path / "b"


def commands_in(folder):
    """Every command that the files of a result suggest, as words."""
    summary = json.loads((folder / "summary.json").read_text())["summary"]["command"]
    markdown = re.findall(r"`(maniport [^`]*)`", (folder / "summary.md").read_text())
    page = re.findall(r"<code>(maniport .*?)</code>", (folder / "report.html").read_text())
    texts = [summary, *markdown, *map(html.unescape, page)]
    return [shlex.split(text) for text in texts]


@pytest.mark.parametrize("name", ["out", "my results", "it's", "-dash", "deep/er"])
def test_suggested_commands_name_the_folder_that_was_written(
    result_with_advice, tmp_path, monkeypatch, name
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "deep").mkdir()
    for overwrite in (False, True):
        report = mp.write_results(result_with_advice, name, overwrite=overwrite)
        suggested = commands_in(tmp_path / name)
        assert len(suggested) == 3
        for words in suggested:
            config = Path(words[words.index("--config") + 1])
            assert config == tmp_path / name / "run.yaml"
            assert config.is_file()
        typed = shlex.split(report.command_for(name))
        written = Path(typed[typed.index("--config") + 1])
        assert (tmp_path / written).is_file()
        assert not str(written).startswith("-")


def test_a_suggested_folder_is_new(result_with_advice, tmp_path):
    mp.write_results(result_with_advice, tmp_path / "out")
    first = commands_in(tmp_path / "out")[0]
    target = Path(first[first.index("-o") + 1])
    target.mkdir()
    mp.write_results(result_with_advice, tmp_path / "out", overwrite=True)
    second = commands_in(tmp_path / "out")[0]
    assert Path(second[second.index("-o") + 1]) == target.with_name(f"{target.name}-2")


def test_a_result_that_was_not_written_suggests_no_command(result_with_advice):
    report = report_of(result_with_advice)
    assert report.command
    assert report.command_for() == ""
    assert "--config" not in as_markdown(report, details=True)
    assert (
        Report("title", command="maniport info {folder}").command_for("a b")
        == "maniport info 'a b'"
    )


@pytest.fixture
def result_with_advice(small_result):
    """A result whose path is missed, so that a command is suggested."""
    n = len(small_result.time)
    arm = small_result.arm
    missed = {"position_error": np.full(n, 0.05), "distance": np.zeros(n)}
    own = replace(arm, motion=replace(arm.motion, **missed))
    config = replace(small_result.config, recording=("ladder",))
    motion = replace(small_result.motion, arms=(own.motion,), trajectory=own.motion)
    return replace(small_result, arms=(own,), motion=motion, config=config)


@pytest.mark.usefixtures("small_search")
def test_the_suggested_command_runs(run, profile, tmp_path, monkeypatch):
    """Of `track` with a path out of reach: the advice of the terminal, of a folder with a space."""
    time = load_ellipsoids(profile)[1]
    mp.util.files.save_path(
        "path.npz", np.tile([2.0, 0.0, 0.5], (len(time), 1)) + 0.01 * time[:, None], time
    )
    code, out, err = run("track", profile, "--path", "path.npz", "--no-collisions", "-o", "my out")
    assert code == 0, err
    line = next(line for line in out.splitlines() if line.startswith("Next"))
    words = shlex.split(line.removeprefix("Next"))
    assert words[:4] == ["maniport", "track", "--config", "my out/run.yaml"]
    code, _, err = run(*words[1:], "--quiet")
    assert code == 0, err
    assert (tmp_path / words[-1] / "joints.csv").is_file()
