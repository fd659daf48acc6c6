"""The command line: commands, options, exit codes, messages. Ctrl-C and closed outputs: test_start."""

import json
import shlex
from dataclasses import replace

import numpy as np
import pytest

import maniport
from crane import CRANE
from maniport import cli, load_arm, pipeline
from maniport.errors import ManiportError
from maniport.mocap import read_recording, shipped_recording
from maniport.motion.exports import FORMATS
from maniport.pipeline.settings import plan_options
from maniport.report import write
from maniport.studies.experiments import _toy_draw
from maniport.util.files import load_ellipsoids, load_path, save_ellipsoids, save_path
from sizes import little_search, panda_profile


@pytest.fixture
def domains(run, tmp_path):
    for arm, n in (("myoarm", 128), ("panda", 256)):
        assert run("domain", arm, "-n", n, "-o", tmp_path / f"{arm}.npz")[0] == 0
    return tmp_path


@pytest.fixture
def small_search():
    with little_search():
        yield


@pytest.mark.parametrize("seed", [0, 1])
def test_fit_recovers_the_toy_of_the_paper_if_the_base_rotation_is_unknown(run, tmp_path, seed):
    """As `RiemannianICP(base_rotation=None)` does; the rotation is random."""
    draw = _toy_draw(seed)
    teacher, student, adapter = (tmp_path / f"{name}.npz" for name in ("t", "s", "a"))
    save_ellipsoids(teacher, draw.teacher)
    save_ellipsoids(student, np.random.default_rng(seed).permutation(draw.student))
    words = ("fit", teacher, student, "-o", adapter, "--damping", "0", "--quiet")
    assert run(*words, "--base-rotation", "unknown")[0] == 0
    ((new, truth),) = draw.evaluation.values()
    loaded = maniport.load_adapter(adapter)
    assert maniport.spd.distance(loaded.transform(new), truth).max() < 1e-6
    assert loaded.base_rotation is None


def test_only_icp_estimates_a_base_rotation(run, domains):
    words = ("fit", domains / "myoarm.npz", domains / "panda.npz", "-o", domains / "a.npz")
    unknown = ("--base-rotation", "unknown")
    for method in ("parallel-transport", "scaled-transport", "mean-transport", "identity"):
        code, _, err = run(*words, *unknown, "--method", method)
        assert (code, "icp" in err) == (2, True)
    for command in (("transfer", "freeform"), ("view", "freeform")):
        code, _, err = run(*command, *unknown)
        assert (code, "icp" in err) == (2, True)
    code, _, err = run(*words, "--base-rotation", "nearby")
    assert (code, "unknown" in err) == (2, True)


def test_each_step_on_its_own(run, domains):
    """Domain, fit and apply; info describes every file; evaluate writes the page."""
    person, panda, adapter = (domains / f"{name}.npz" for name in ("myoarm", "panda", "a"))
    code, out, _ = run("fit", person, panda, "-o", adapter, "--json")
    assert (code, json.loads(out)["adapter"]["damping"]) == (0, 0.01)
    assert run("fit", person, panda, "-o", adapter, "--quiet") == (0, "", "")
    assert run("apply", adapter, person, "-o", domains / "adapted.npz")[0] == 0
    original, _ = load_ellipsoids(person)
    mapped = maniport.load_adapter(adapter).transform(original)
    np.testing.assert_allclose(load_ellipsoids(domains / "adapted.npz")[0], mapped, rtol=1e-12)
    for what, word in (
        (adapter, "RiemannianICP"),
        (person, "128 of 3 × 3"),
        ("panda", "panda_joint7"),
    ):
        code, out, _ = run("info", what)
        assert (code, word in out) == (0, True)
    save_ellipsoids(domains / "profile.npz", original[:12])
    words = ("evaluate", adapter, person, panda, domains / "profile.npz", "-o")
    code, out, _ = run(*words, domains / "page.md")
    assert (code, "identity" in out) == (0, True)
    assert (domains / "page.md").read_text().strip() == out.strip()
    assert run(*words, domains / "page.json", "--quiet")[:2] == (0, "")
    assert json.loads((domains / "page.json").read_text())
    code, _, err = run(*words, domains / "page.txt")
    assert (code, ".md or .json" in err) == (2, True)
    code, _, err = run("fit", person, panda, "-o", adapter, "--method", "auto")
    assert (code, "use maniport transfer, or name a method" in err) == (2, True)


def test_fit_uses_the_robot_where_it_is_named(run, domains):
    adapters = {}
    for options in ((), ("--robot", "panda")):
        words = (
            domains / "panda-half.npz",
            domains / "panda.npz",
            "-o",
            domains / "a.npz",
            "--method",
            "length-field",
        )
        save_ellipsoids(words[0], 0.5 * load_ellipsoids(domains / "panda.npz")[0][:64])
        assert run("fit", *words, "--quiet", *options)[0] == 0
        adapters[bool(options)] = maniport.load_adapter(domains / "a.npz")
    assert adapters[False].from_samples_
    assert not adapters[True].from_samples_
    assert adapters[True].cost_ < adapters[False].cost_


def test_locked_joints_of_any_robot_are_in_degrees(run, tmp_path):
    (tmp_path / "crane.urdf").write_text(CRANE)
    assert "nod at 10°" in run("info", tmp_path / "crane.urdf", "--lock", "nod=10")[1]
    code, _, err = run(
        "domain", tmp_path / "crane.urdf", "--lock", "nod=100", "-o", tmp_path / "domain.npz"
    )
    assert (code, "--lock: nod is 100°; allowed are -57.30° to 57.30°" in err) == (2, True)
    code, _, err = run("fit", "a.npz", "b.npz", "--lock", "nod=100", "-o", tmp_path / "a.npz")
    assert (code, "need --robot" in err) == (2, True)


def test_info_describes_results(run, tmp_path):
    save_path(tmp_path / "path.npz", np.zeros((5, 3)), np.linspace(0.0, 2.0, 5))
    assert "Path: 5 positions\n- Duration: 2 s\n" in run("info", tmp_path / "path.npz")[1]
    (tmp_path / "summary.md").write_text("# a → b\n\n## It follows.\n")
    (tmp_path / "summary.json").write_text('{"title": "a → b", "status": "amber"}')
    assert "## It follows." in run("info", tmp_path)[1]
    assert json.loads(run("info", tmp_path, "--json")[1])["status"] == "amber"
    (tmp_path / "summary.json").write_text("[1")
    code, _, err = run("info", tmp_path, "--json")
    assert (code, "summary.json: is no summary of a run" in err) == (2, True)
    (tmp_path / "many").mkdir()
    (tmp_path / "many" / "batch.json").write_text("{}")
    code, _, err = run("info", tmp_path / "many")
    assert (code, "is the folder of a batch" in err) == (2, True)


def test_the_printed_template_completes_the_arm(run, tmp_path):
    """The template of `info --json` is filled in and passed, and is enough for the printed command."""
    recording = read_recording("ladder").crop(10, 11)
    file = tmp_path / "a walk.npz"
    renamed = {"RightArm": "mark 1", "RightForeArm": "mark 2", "RightHand": "mark 3"}
    replace(recording, names=tuple(renamed.get(name, name) for name in recording.names)).save(file)
    code, out, _ = run("info", file, "--json")
    printed = json.loads(out)
    assert (code, printed["arms"]["right"]["lacks"]) == (
        0,
        ["shoulder", "elbow", "wrist", "trunk_left"],
    )
    filled = {
        "shoulder": ["mark 1"],
        "elbow": ["mark 2"],
        "wrist": ["mark 3"],
        "trunk_left": [["mark 1"], ["LeftArm"]],
    }
    assert filled.keys() == printed["to_complete"]["markers"].keys()
    assert printed["to_complete"]["markers"]["wrist"] == ["NAME"]
    markers = tmp_path / "markers.json"
    markers.write_text(json.dumps(filled))
    code, out, _ = run("info", file, "--markers", markers)
    assert code == 0
    assert "Right arm: complete" in out
    line = next(line for line in run("info", file)[1].splitlines() if "maniport transfer" in line)
    words = shlex.split(line.split("`")[1].replace(" markers.json", f" {markers}"))[1:-2]
    code, _, err = run(*words, "--robot", "nobody", "-o", tmp_path / "out")
    assert "unknown robot 'nobody'" in err  # the recording was accepted


@pytest.mark.slow
@pytest.mark.usefixtures("small_search")
def test_transfer_writes_a_folder(run, tmp_path):
    out = tmp_path / "out"
    words = (
        "transfer",
        shipped_recording("freeform"),
        "-o",
        out,
        "--start",
        2,
        "--stop",
        2.5,
        "--n-teacher",
        64,
        "--n-student",
        128,
    )
    exports = [word for name in FORMATS if name != write.SCENE for word in ("--export", name)]
    code, text, err = run(*words, *exports, "--method", "parallel-transport", "--json")
    assert code == 0, err
    assert json.loads(text)["run"]["ellipsoids"]["count"] > 10
    files = {file.name for file in out.iterdir()}
    exported = {exporter.file for name, exporter in FORMATS.items() if name != write.SCENE}
    assert files >= {"summary.md", "run.yaml"} | exported
    code, _, err = run(
        "transfer", "--config", out / "run.yaml", "-o", tmp_path / "again", "--quiet"
    )
    assert code == 0, err
    assert (tmp_path / "again" / "joints.csv").read_bytes() == (out / "joints.csv").read_bytes()
    (tmp_path / "run.yaml").write_text((out / "run.yaml").read_text().replace("fps:", "fsp:"))
    code, _, err = run("transfer", "--config", tmp_path / "run.yaml", "-o", tmp_path / "third")
    assert (code, "unknown key 'fsp'" in err) == (2, True)


@pytest.mark.slow
@pytest.mark.usefixtures("small_search")
def test_track_and_place(run, tmp_path):
    """`place` ranks placements above the table and writes one, `track` writes joints.csv; run.yaml repeats both."""
    _, time, _, ellipsoids, path = panda_profile()
    save_ellipsoids(tmp_path / "p.npz", ellipsoids, time)
    save_path(tmp_path / "h.npz", path)
    profile = tmp_path / "p.npz", "--path", tmp_path / "h.npz"
    box = ("--workspace", "0.2,inf,-0.3,0.3,-inf,inf", "--table", 0.0)
    code, out, err = run(
        "place", *profile, *box, "--scale", 0.8, "-o", tmp_path / "placed", "--json"
    )
    assert code == 0, err
    assert json.loads(out)["placement"]["scale"] == pytest.approx(0.8)
    ranking = json.loads(out)["placement"]["candidates"]
    assert [candidate["rank"] for candidate in ranking] == list(range(1, len(ranking) + 1))
    path, time = load_path(tmp_path / "placed" / "path.npz")
    assert np.all(path >= np.array([0.2, -0.3, 0.0]) - 1e-8)
    assert path[:, 1].max() <= 0.3 + 1e-8
    np.testing.assert_array_equal(
        time, load_ellipsoids(tmp_path / "placed" / "placed_profile.npz")[1]
    )
    code, out, err = run("track", *profile, "--speed-scale", 0.5, "--json", "-o", tmp_path / "out")
    assert code == 0, err
    assert json.loads(out)["motion"]["distance"]["p95"] < 0.2
    assert (tmp_path / "out" / "joints.csv").read_text().startswith("time_s,panda_joint1_rad")
    for verb, first in (("place", "placed"), ("track", "out")):
        again = tmp_path / f"{first}-again"
        code, _, err = run(verb, "--config", tmp_path / first / "run.yaml", "-o", again, "--quiet")
        assert code == 0, err
        for file in (
            "run.yaml",
            "placed_profile.npz",
            "path.npz",
            *(["joints.csv"] if verb == "track" else []),
        ):
            assert (again / file).read_bytes() == (tmp_path / first / file).read_bytes(), file


@pytest.mark.parametrize(
    ("words", "found"),
    [
        (("info", "pnda"), "'panda'"),
        (("info", "missing.npz"), "missing.npz"),
        (("info", "tail.bvh"), "missing: shoulder"),
        (("info", "x" * 300), ("name too long", "unknown robot")),
        (("domain", "panda", "-n", "0", "-o", "x.npz"), "n must"),
        (("domain", "panda", "--part", "whole", "-o", "x.npz"), "translation"),
        (("fit", "a.npz", "b.npz", "-o", "c.npz"), "a.npz"),
        (("transfer", "a.bvh"), "a.bvh: there is no such file"),
        (("transfer", "tail.bvh"), "missing: shoulder"),
        (("transfer",), "exactly one file"),
        (("learn", "a.bvh"), "demonstrations"),
        (("track", "a.npz"), "a.npz"),
        (("place", "a.npz", "--path", "b.npz"), "a.npz"),
        (("track",), "target ellipsoids"),
        (("transfer", "ladder", "--robot", "pnda"), "'panda'"),
        (("transfer", "ladder", "--overwrite"), "--output"),
        (("batch", "a.bvh"), "a.bvh"),
        (("batch", "ladder", "--robot", "pnda"), "'panda'"),
        (("batch", "ladder"), "Missing option '--output'"),
        (("batch", "ladder", "--seed", "-1"), "--seed"),
        (("domain", "pnda"), "'panda'"),
        (("domain", "panda"), "Missing option '--output'"),
        (("domain", "panda", "-n", "0"), "n must"),
        (("fit", "a.npz", "b.npz"), "a.npz"),
        (("apply", "a.npz", "b.npz"), "a.npz"),
        (("fit", "a.npz"), "student"),
        (("transfer", "ladder", "-o", "out", "--markers", "list.json"), "list.json"),
        (("transfer", "ladder", "-o", "out", "--markers", "half.json"), "half.json"),
        (("transfer", "ladder", "-o", "out", "--markers", "deep.json"), "deep.json"),
        (("transfer", "missing.bvh", "-o", "."), "holds other things"),
        (
            ("place", "a.npz", "--path", "b.npz", "-o", "c", "--tilt", "much"),
            "unknown --tilt 'much'",
        ),
        (("track", "still.npz", "-o", "out"), "no times"),
        (("track", "one.npz", "-o", "out"), "one.npz' must have shape (n,) with n ≥ 2"),
        (("demo", "stairs", "-o", "out"), "'freeform'"),
    ],
)
def test_wrong_input_ends_with_one_sentence(run, tmp_path, monkeypatch, words, found):
    monkeypatch.chdir(tmp_path)
    contents = {"list.json": "[1, 2]", "half.json": "{", "deep.json": '{"a":' * 40_000}
    contents["tail.bvh"] = (
        "HIERARCHY\nROOT Tail\n{\nOFFSET 0 0 0\nCHANNELS 3 Xposition Yposition Zposition\n"
        "End Site\n{\nOFFSET 0 1 0\n}\n}\nMOTION\nFrames: 1\nFrame Time: 0.1\n0 0 0\n"
    )
    for name, text in contents.items():
        (tmp_path / name).write_text(text)
    save_ellipsoids(tmp_path / "still.npz", np.tile(np.eye(3), (3, 1, 1)))
    save_ellipsoids(tmp_path / "one.npz", np.eye(3)[None], [0.0])
    before = set(tmp_path.iterdir())
    code, _, err = run(*words)
    assert code == 2
    assert any(word in err for word in ([found] if isinstance(found, str) else found)), err
    assert "Traceback" not in err
    assert set(tmp_path.iterdir()) == before


@pytest.mark.parametrize("command", ["demo", "transfer", "learn", "track", "place", "reproduce"])
def test_an_earlier_result_stays_unless_it_may_be_overwritten(run, tmp_path, command):
    own = {"learn": "path.npz", "place": "path.npz", "reproduce": "paper.md"}.get(
        command, "joints.csv"
    )
    (tmp_path / own).write_text("earlier")
    one_file = {
        "transfer": ("no.bvh",),
        "learn": ("no.bvh",),
        "track": ("no.npz",),
        "reproduce": ("toy",),
    }
    words = {"demo": (), "place": ("no.npz", "--path", "no.npz"), **one_file}[command]
    code, _, err = run(command, *words, "-o", tmp_path)
    assert code == 2
    assert "holds an earlier result; give --overwrite" in err
    assert (tmp_path / own).read_text() == "earlier"
    (tmp_path / "notes.txt").write_text("mine")
    code, _, err = run(command, *words, "-o", tmp_path, "--overwrite")
    assert (code, "holds other things ('notes.txt')" in err) == (2, True)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "unused"),
    [
        ("track", ("--capability", "--capability-weight", "--direction", "--directions")),
        ("live", ("--rate",)),
    ],
)
def test_options_that_a_command_does_not_use_are_not_offered(run, command, unused):
    _, complete, _ = run(command, "--help-all")
    _, transfer, _ = run("transfer", "--help-all")
    for option in unused:
        assert f"{option} " not in complete
        assert f"{option} " in transfer


def test_every_command_has_help_with_an_example(run):
    for command in cli.ORDER:
        code, out, _ = run(command, "--help")
        assert code == 0
        assert f"Example: maniport {command}" in out
        assert len(out.splitlines()) <= 64
        code, complete, _ = run(command, "--help-all")
        assert (code, len(complete.splitlines()) >= len(out.splitlines())) == (0, True)
        if command == "track":
            assert all(name in out for name in FORMATS)
            assert out.index("Motion:") < out.index("--position-tolerance")


@pytest.fixture
def track(run, monkeypatch, tmp_path):
    """Call `maniport track` with options; return standard error, and the configurations that the library got."""
    save_ellipsoids(tmp_path / "p.npz", np.tile(np.eye(3), (3, 1, 1)), [0.0, 1.0, 2.0])
    configs = []

    def stop(arm, targets, config, **_):
        plan_options(config, arm)
        configs.append(config)
        raise ManiportError("no work")

    monkeypatch.setattr(pipeline, "follow_profile", stop)
    return lambda *words: (
        run("track", tmp_path / "p.npz", "-o", tmp_path / "out", "--quiet", *words)[2],
        configs,
    )


def test_units_of_the_command_line_are_converted(track):
    panda = load_arm("panda")
    home = "0,-45,0,-135,0,90,45"
    words = (
        "--position-tolerance",
        12,
        "--speed-scale",
        0.5,
        "--joint-limit-margin",
        5,
        "--home",
        home,
        "--table",
        0,
    )
    _, (asked,) = track(*words, "--orientation", "0,0,-1")
    assert asked.position_tolerance == pytest.approx(0.012)
    assert asked.speed_scale == 0.5
    assert asked.orientation == (0.0, 0.0, -1.0)
    np.testing.assert_allclose(asked.home, np.radians([float(word) for word in home.split(",")]))
    lower = panda.lower + 0.05 * (panda.upper - panda.lower)
    control = plan_options(asked, panda)
    np.testing.assert_allclose(control.motion_limits.arm.lower, lower, atol=1e-12)
    assert "table" in np.array(control.collisions.pairs)


@pytest.mark.parametrize(
    ("words", "found"),
    [
        (("--home", "0,-45"), "--home must have 7 numbers, for panda_joint1"),
        (
            ("--home", "0,-100,0,-135,0,90,45"),
            "--home: panda_joint2 is -100°; allowed are -96.96° to 96.96°",
        ),
        (("--home", "0,60,0,-160,0,5,0"), "home: panda_link0 and panda_link6"),
        (("--table", 0.3), "table: the plane at z = 0.3 m goes through the robot's base"),
        (
            ("--joint-limit-margin", 50),
            "--joint-limit-margin [%] must be a number in [0, 40]; found '50'",
        ),
        (
            ("--position-tolerance", 0),
            "--position-tolerance [mm] must be a number above 0; found '0'",
        ),
        (("--export", "ros"), "unknown export 'ros'; available, nearest first: 'ros2'"),
        (
            ("--limits", "limits.yaml"),
            "unknown key 'joint1'; allowed are, nearest first: panda_joint1",
        ),
        (("--srdf", "nothing.srdf"), "nothing.srdf"),
        (("--orientation", "0,0,-1", "--orientation-axes", "whole"), "orientation_axes"),
        (("--scale", 0), "--scale must be a number in (0, 10]; found '0'"),
        (("--workspace", "0.5,0.2,0,1,0,1"), "workspace[0][1]"),
    ],
)
def test_wrong_options_end_with_one_sentence_before_any_work(
    track, tmp_path, monkeypatch, words, found
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "limits.yaml").write_text("joints: {joint1: {velocity: 1}}")
    err, configs = track(*words)
    assert (found in err, configs) == (True, [])
    assert "╭" not in err
