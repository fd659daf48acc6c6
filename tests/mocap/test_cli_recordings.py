"""What the command line says of recordings, and what it lets users say of them."""

import json
import shlex

import pytest

from maniport import cli
from maniport.mocap import read_recording


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
