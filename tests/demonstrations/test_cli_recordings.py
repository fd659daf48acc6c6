"""What the command line says of recordings, and what it lets users say of them."""

import json
import shlex

import pytest

from maniport import cli
from maniport.demonstrations import read_recording


@pytest.fixture
def run(monkeypatch, capsys):
    """Call the command line in this process; return exit code, standard output and standard error."""

    def call(*words):
        monkeypatch.setattr("sys.argv", ["maniport", *map(str, words)])
        with pytest.raises(SystemExit) as stop:
            cli.main()
        out, err = capsys.readouterr()
        return int(stop.value.code or 0), out, err

    return call


@pytest.fixture
def strange(tmp_path):
    """A second of the ladder under names that nobody knows, as a file."""
    recording = read_recording("ladder").crop(10, 11)
    known = {"RightArm": "mark 1", "RightForeArm": "mark 2", "RightHand": "mark 3"}
    names = tuple(known.get(name, name) for name in recording.names)
    file = tmp_path / "a walk.npz"
    type(recording)(names, recording.positions, recording.time, recording.up).save(file)
    return file


def test_the_printed_template_completes_the_arm(run, strange, tmp_path):
    """What `info --json` prints is filled in, given back, and is enough for the whole way, by the printed line."""
    code, out, _ = run("info", strange, "--json")
    told = json.loads(out)
    assert (code, told["arms"]["right"]["lacks"]) == (0, ["shoulder", "elbow", "wrist", "trunk_left"])
    template = told["to_complete"]["markers"]
    filled = {"shoulder": ["mark 1"], "elbow": ["mark 2"], "wrist": ["mark 3"], "trunk_left": [["mark 1"], ["LeftArm"]]}
    assert filled.keys() == template.keys()
    markers = tmp_path / "markers.json"
    markers.write_text(json.dumps(filled))
    code, out, _ = run("info", strange, "--markers", markers)
    assert code == 0
    assert "Right arm: complete" in out
    line = next(line for line in run("info", strange)[1].splitlines() if "maniport transfer" in line)
    words = shlex.split(line.split("`")[1].replace(" markers.json", f" {markers}"))[1:-2]
    code, _, err = run(*words, "--robot", "nobody", "-o", tmp_path / "out")
    assert "unknown robot 'nobody'" in err  # the recording was taken


def test_names_of_shipped_recordings_are_told(run):
    """`maniport info ladder` needs no path."""
    code, out, _ = run("info", "ladder")
    assert code == 0
    assert "Right arm: complete" in out


@pytest.mark.parametrize(
    ("options", "found"),
    [
        (("--unit", "m"), "--unit m makes the upper arm (RightArm to RightForeArm) 30 m long; those of people have"),
        (("--unit", "m"), "--unit cm makes it 0.3 m"),
        (("--up", "sideways"), "unknown up 'sideways'"),
    ],
)
def test_what_is_contradicted_is_told_in_options(run, bvh_file, options, found):
    """A unit that makes no person ends with a sentence that names the option that does."""
    code, _, err = run("info", bvh_file(), *options)
    assert code == 2
    assert found in err


def test_a_forced_axis_is_told_first(run, bvh_file):
    """Whoever gives an axis that the points contradict reads it before all else, in the words of the command line."""
    code, out, _ = run("info", bvh_file(), "--up", "z")
    assert code == 0
    assert "--up z lets the trunk (Spine to Neck) stand 90° off upright (median); --up y" in out.split("## The rec")[0]


def test_the_other_arm_is_told_in_options(run, bvh_file, tmp_path):
    """Points of the left arm given to the right one end with the option that takes the left one."""
    markers = tmp_path / "markers.json"
    markers.write_text('{"elbow": ["LeftArm"]}')
    code, _, err = run("transfer", bvh_file(), "-o", tmp_path / "out", "--markers", markers)
    assert code == 2
    assert "elbow of the right arm: 'LeftArm' is a point of the left one; give --arm left or other --markers" in err


def test_either_arm_is_asked_for_by_an_option(run, tmp_path):
    """--arm and --height reach persons by name and recordings; robots have neither; an arm that is missing is told."""
    code, out, _ = run("info", "myoarm", "--arm", "left", "--height", "1.8")
    assert code == 0
    assert "Arm: myoarm_left, a person's left arm" in out
    code, out, _ = run("domain", "myoarm", "--arm", "left", "-n", "4", "-o", tmp_path / "left.npz", "--json")
    assert (code, json.loads(out)["arm"]) == (0, "myoarm_left")
    assert json.loads(run("info", "ladder", "--json")[1])["arms"]["fitted"] == "right"
    for words, said in (
        (("info", "panda", "--arm", "left"), "--arm is for persons (myoarm, rhuman"),
        (("info", "myoarm", "--height", "180"), "height [m] must be a number in [1, 2.5]; found 180"),
        (("transfer", "ladder", "--arm", "left", "-o", tmp_path / "out"), "There is a right arm: --arm right takes it"),
        (("transfer", "ladder", "--arm", "both", "-o", tmp_path / "out"), "place two robots with --base-left"),
        (("info", "ladder", "--fps", "0"), "--fps [Hz] must be a number in (0, 100000); found 0"),
        (("transfer", "ladder", "--stop", "0.01", "-o", tmp_path / "out"), "frames of 'ladder.bvh': 1; at least 3"),
    ):
        code, _, err = run(*words)
        assert (code, said in err) == (2, True), err


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_markers_as_editors_on_windows_write_them(run, strange, tmp_path, encoding):
    """A mark of the encoding in front of a file of markers does not matter."""
    markers = tmp_path / "markers.json"
    markers.write_text('{"shoulder": "mark 1"}', encoding=encoding)
    assert json.loads(run("info", strange, "--json", "--markers", markers)[1])["arms"]["right"]["lacks"] == [
        "elbow", "wrist", "trunk_left",
    ]  # fmt: skip


def test_a_single_frame_has_no_rate(run, bvh_file):
    """It is told as one frame, and as null in JSON."""
    file = bvh_file(frames=1)
    assert "Frames: 1.\n" in run("info", file)[1]
    assert json.loads(run("info", file, "--json")[1])["recording"]["rate_hz"] is None
