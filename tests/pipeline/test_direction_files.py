"""Files with lines of force and speed: what is read, and what is refused before long work."""

import numpy as np
import pytest
import yaml

import maniport as mp
from maniport.errors import FileFormatError, InvalidInputError, ManiportError
from maniport.pipeline import Config
from maniport.pipeline.direction_files import given_lines, read_lines
from maniport.pipeline.human import fit_human
from maniport.pipeline.settings import settings_of
from maniport.pipeline.transfer import Transfer

FORCE = "direction_force_x,direction_force_y,direction_force_z"
SPEED = "direction_speed_x,direction_speed_y,direction_speed_z"


def table(path, header, rows):
    lines = [header, *(",".join(map(str, row)) for row in rows)]
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.fixture
def force(tmp_path):
    """A line from x to y over the second from 10 to 11 s, the second row with the other sign."""
    return table(tmp_path / "force.csv", f"time_s,{FORCE}", [(10, 3, 0, 0), (11, 0, -2, 0)])


def test_lines_are_interpolated_without_their_signs(tmp_path):
    rows = [(0, 1, 0, 0), (1, -1, -0.1, 0), (2, 0.5, 0.2, 0)]
    given = read_lines(table(tmp_path / "lines.csv", f"time_s,{FORCE}", rows))
    lines = given.at(np.array([0.0, 0.5, 1.0, 1.5, 2.0]), "force")
    np.testing.assert_allclose(np.linalg.norm(lines, axis=1), 1.0)
    angles = np.degrees(np.arctan(lines[:, 1] / lines[:, 0]))
    first = np.degrees(np.arctan(0.1))
    last = np.degrees(np.arctan(0.4))
    np.testing.assert_allclose(angles[[0, 2, 4]], [0.0, first, last], atol=1e-9)
    assert 0.0 < angles[1] < first < angles[3] < last


@pytest.mark.parametrize("time_name", ["time_s", "time"])
def test_tables_and_arrays_are_read_alike(tmp_path, time_name):
    numbers = np.random.default_rng(0).normal(size=(5, 7))
    numbers[:, 0] = np.arange(5.0)
    names = [time_name, *FORCE.split(","), *SPEED.split(",")]
    np.savez(tmp_path / "lines.npz", **dict(zip(names, numbers.T, strict=True)))
    header = ",".join(f'"{name}"' for name in ["note", *names])
    rows = [["a text", *row] for row in numbers.tolist()]
    path = table(tmp_path / "lines.csv", header, rows)
    path.write_bytes(b"\xef\xbb\xbf" + path.read_text().replace("\n", "\r\n").encode())

    arrays = read_lines(tmp_path / "lines.npz")
    texts = read_lines(path)
    for kind, first in (("force", 1), ("velocity", 4)):
        vectors = numbers[:, first : first + 3]
        expected = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
        at_rows = arrays.at(numbers[:, 0], kind)
        np.testing.assert_allclose(np.abs(np.sum(at_rows * expected, axis=1)), 1.0)
        np.testing.assert_array_equal(texts.at(numbers[:, 0], kind), at_rows)


def test_tiny_and_huge_vectors_have_a_direction(tmp_path):
    rows = [(0, 3e-310, 4e-310, 0), (1, 3e300, 4e300, 0)]
    given = read_lines(table(tmp_path / "lines.csv", f"time_s,{SPEED}", rows))
    assert list(given.lines) == ["velocity"]
    np.testing.assert_allclose(given.at(np.array([0.0, 1.0]), "velocity"), [[0.6, 0.8, 0]] * 2)


ROWS = "0,1,0,0\n1,0,1,0\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "empty"),
        ("time_s\n", "time_s"),
        (f"time_s,{FORCE}\n", "rows"),
        (f"{FORCE}\n1,0,0\n", "time_s"),
        ("time_s,x,y,z\n" + ROWS, "direction_force_x"),
        ("time_s,direction_force_x,direction_speed_y\n0,1,1\n", "lacks direction_force_y"),
        (f"time_s,{FORCE}\n0,1,0,0\n1,nan,0,0\n", "nan"),
        (f"time_s,{FORCE}\n0,1,0,0\n1,1e999,0,0\n", "inf"),
        (f"time_s,{FORCE}\n0,1,0,0\n1,0,0,0\n", "0, 0, 0 at 1 s"),
        (f"time_s,{FORCE}\n0,1,0,0\n1,0,1\n", "numbers"),
        (f"time_s,{FORCE}\n0,1,0,0\n1,,0,1\n", "numbers"),
        (f"time_s;{FORCE.replace(',', ';')}\n0;1;0;0\n", "commas"),
        (f"time_s,{FORCE}\n1,1,0,0\n0,0,1,0\n", "increase"),
        (f"time_s,{FORCE}\nnan,1,0,0\n1,0,1,0\n", "time_s"),
    ],
)
def test_faults_of_tables_are_named(tmp_path, text, words):
    path = tmp_path / "lines.csv"
    path.write_text(text)
    with pytest.raises(FileFormatError, match=words) as caught:
        read_lines(path)
    assert str(path) in str(caught.value)


def test_faults_of_arrays_are_named(tmp_path):
    path = tmp_path / "lines.npz"
    good = dict.fromkeys(FORCE.split(","), np.ones(3)) | {"time": np.arange(3.0)}
    faults = {
        "direction_force_z": {"direction_force_z": np.ones(2)},
        "numbers": {"direction_force_y": np.array(["a", "b", "c"])},
        "one number for each": {name: np.ones(2) for name in FORCE.split(",")},
        "time": {"time": np.zeros((3, 1))},
    }
    np.savez(path, **good)
    assert read_lines(path).lines["force"].shape == (3, 3)
    for words, changed in faults.items():
        np.savez(path, **(good | changed))
        with pytest.raises(FileFormatError, match=words):
            read_lines(path)
    for content in (b"", b"PK\x03\x04"):
        path.write_bytes(content)
        with pytest.raises(FileFormatError):
            read_lines(path)


def test_options_that_contradict_files_are_refused(force):
    for other in ({"direction": "path"}, {"direction": (1, 0, 0)}, {"capability": "none"}):
        with pytest.raises(InvalidInputError, match="directions"):
            Config(directions=force, **other)
    contradictions = [
        ({"move": False}, "move"),
        ({"part": "rotation"}, "part"),
        ({"directions": (force, force)}, "one file for each arm"),
        ({"capability": "speed"}, "direction_speed_x"),
        ({"directions": "nowhere.csv"}, "no such file"),
    ]
    for options, words in contradictions:
        with pytest.raises(ManiportError, match=words):
            settings_of(Config(**{"directions": force, **options}))
    allowed = Config(directions=force, capability="force")
    assert [list(given.lines) for given in given_lines(allowed, 1)] == [["force"]]


def test_times_must_cover_the_part_that_is_used(force, second):
    settings = settings_of(Config(directions=force))
    assert len(fit_human(second, settings).motion) > 10
    ladder = {"robot": "panda", "directions": force}
    for part in ({"start": 9.9, "stop": 10.5}, {"start": 10.5, "stop": 11.1}):
        with pytest.raises(InvalidInputError, match="must cover"):
            Transfer.of(settings_of(Config(**ladder, **part))).read("ladder")


def test_two_arms_have_a_file_each(force, tmp_path):
    speed = table(tmp_path / "speed.npz.csv", f"time,{SPEED}", [(5, 0, 0, 1), (6, 0, 1, 0)])
    config = Config(
        robot=("panda", "panda"),
        pose=((0, 0.3, 0, 0), (0, -0.3, 0, 0)),
        side="both",
        directions=(force, speed),
    )
    left, right = settings_of(config).given_lines
    assert (list(left.lines), list(right.lines)) == (["force"], ["velocity"])
    with pytest.raises(InvalidInputError, match="left first"):
        settings_of(config.changed(directions=force))


def test_files_are_kept_with_their_whole_paths(force, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Config(directions="force.csv").save("run.yaml")
    saved = yaml.safe_load((tmp_path / "run.yaml").read_text())
    assert saved["motion"]["directions"] == [str(force)]
    assert Config.load("run.yaml").directions == (str(force),)


def test_motions_without_a_person_have_no_lines(force, panda):
    targets = mp.motion.TargetTrajectory.checked(
        panda, np.arange(3.0), panda.manipulability(np.full((3, 7), 0.3))
    )
    with pytest.raises(InvalidInputError, match=r"directions.*person"):
        mp.pipeline.follow_profile(panda, targets, directions=force)
