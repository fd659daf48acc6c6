"""The command line: verbs, exit codes, messages, interruption."""

import json
import re
import signal
import subprocess
import sys

import numpy as np
import pytest
from typer.main import get_command

from maniport import cli, load_arm
from maniport.demonstrations import shipped_recording
from maniport.files import load_ellipsoids, load_path, save_ellipsoids, save_path
from maniport.pipeline import transfer_recording
from sizes import few_places


@pytest.fixture
def run(monkeypatch, capsys):
    """Call the command line in this process; return exit code, standard output and standard error."""

    def call(*words):
        monkeypatch.setattr(sys, "argv", ["maniport", *map(str, words)])
        with pytest.raises(SystemExit) as stop:
            cli.main()
        out, err = capsys.readouterr()
        return int(stop.value.code or 0), out, err

    return call


@pytest.fixture
def domains(run, tmp_path):
    """Small domains of the person and the robot, as files."""
    for arm, n in (("myoarm", 128), ("panda", 256)):
        assert run("domain", arm, "-n", n, "-o", tmp_path / f"{arm}.npz")[0] == 0
    return tmp_path


def test_each_step_on_its_own(run, domains):
    """Domain, fit, apply and back: the ellipsoids return, and info describes every file."""
    adapter, adapted, back = (domains / name for name in ("a.npz", "adapted.npz", "back.npz"))
    assert run("fit", domains / "myoarm.npz", domains / "panda.npz", "-o", adapter)[0] == 0
    assert run("apply", adapter, domains / "myoarm.npz", "-o", adapted)[0] == 0
    assert run("apply", adapter, adapted, "--inverse", "-o", back)[0] == 0
    original, _ = load_ellipsoids(domains / "myoarm.npz")
    np.testing.assert_allclose(load_ellipsoids(back)[0], original, atol=1e-9 * original.max())
    for what, word in ((adapter, "RiemannianICP"), (adapted, "128 of 3 × 3"), ("panda", "panda_joint7")):
        code, out, _ = run("info", what)
        assert code == 0
        assert word in out


def test_info_tells_what_a_run_wrote(run, tmp_path):
    """A folder of results tells its verdict and its page, a path how long it is; a damaged summary is named."""
    save_path(tmp_path / "path.npz", np.zeros((5, 3)), np.linspace(0.0, 2.0, 5))
    assert "Path: 5 positions.\n- Duration: 2 s." in run("info", tmp_path / "path.npz")[1]
    (tmp_path / "report.html").write_text("")
    (tmp_path / "summary.json").write_text(
        '{"title": "a → b", "status": "amber", "verdict": {"title": "It follows."}, '
        '"warnings": [{"key": "assumed-jerk-limits", "text": "Jerk limits are assumed."}]}'
    )
    out = run("info", tmp_path)[1]
    assert "It follows." in out
    assert "- Status: amber." in out
    assert "- Jerk limits are assumed." in out
    assert f"Page: {tmp_path / 'report.html'}." in out
    (tmp_path / "summary.json").write_text("[1]")
    code, _, err = run("info", tmp_path)
    assert (code, "summary.json: is no summary of a run" in err) == (2, True)


def test_fit_has_nothing_to_choose_by(run, domains):
    """A method is chosen by a motion and a robot, which domains alone are not; the message says where it is done."""
    words = ("fit", domains / "myoarm.npz", domains / "panda.npz", "-o", domains / "a.npz", "--method", "auto")
    code, _, err = run(*words)
    assert code == 2
    assert "use maniport transfer, or name a method" in err


@pytest.mark.parametrize("verb", ["transfer", "fit"])
def test_help_lists_the_methods_that_the_error_lists(run, domains, verb):
    """The help of --method and the message about an unknown method name the same methods."""
    words = {"transfer": ("freeform",), "fit": (domains / "myoarm.npz", domains / "panda.npz")}[verb]
    code, _, err = run(verb, *words, "-o", domains / "out.npz", "--method", "nope")
    assert code == 2
    (option,) = [one for one in get_command(cli.app).commands[verb].params if one.name == "method"]
    listed = set(option.help.rstrip(".").partition(": ")[2].split(", "))
    assert listed == set(re.findall(r"'([a-z-]+)'", err.partition("nearest first")[2]))


@pytest.mark.parametrize("method", ["icp", "parallel-transport", "nearest-neighbor"])
def test_methods_by_name(run, domains, method):
    """Every method can be fitted, with the numbers as JSON and nothing else on standard output."""
    words = ("fit", domains / "myoarm.npz", domains / "panda.npz", "-o", domains / "a.npz", "--method", method)
    code, out, _ = run(*words, "--json")
    assert code == 0
    assert json.loads(out)["adapter"]["damping"] == 0.01


def test_quiet_prints_nothing(run, domains):
    """With --quiet neither standard output nor standard error gets a word."""
    code, out, err = run("fit", domains / "myoarm.npz", domains / "panda.npz", "-o", domains / "a.npz", "--quiet")
    assert (code, out, err) == (0, "", "")


def test_transfer_writes_a_folder(run, tmp_path, monkeypatch):
    """The whole way from a recording, cut to half a second, to a folder."""
    monkeypatch.setitem(transfer_recording.__kwdefaults__, "n_teacher", 64)
    monkeypatch.setitem(transfer_recording.__kwdefaults__, "n_student", 128)
    out = tmp_path / "out"
    words = ("transfer", shipped_recording("freeform"), "-o", out, "--start", 2, "--stop", 2.5)
    with few_places():
        code, text, err = run(*words, "--method", "parallel-transport", "--json")
    assert code == 0, err
    assert json.loads(text)["run"]["ellipsoids"]["count"] > 10
    assert (out / "summary.md").is_file()


@pytest.mark.parametrize(
    ("words", "found"),
    [
        (("info", "pnda"), "'panda'"),
        (("info", "missing.npz"), "missing.npz"),
        (("info", "missing.bvh"), "missing.bvh"),
        (("info", "panda", "--frame", "panda_link88"), "'panda_link8'"),
        (("domain", "panda", "-n", "0", "-o", "x.npz"), "n must be a whole number of at least 1"),
        (("domain", "panda", "-o", "x.txt"), ".npz"),
        (("domain", "panda", "--part", "whole", "-o", "x.npz"), "translation"),
        (("fit", "a.npz", "b.npz", "-o", "c.npz"), "a.npz"),
        (("apply", "a.npz", "b.npz", "-o", "c.npz"), "a.npz"),
        (("transfer", "missing.c3d", "-o", "out"), "missing.c3d"),
        (("transfer", "pyproject.toml", "-o", "out"), "no such file"),
        (("place", "a.npz", "--path", "b.npz", "-o", "c", "--tilt", "much"), "tilt must be a number [deg] or 'free'"),
        (("fly",), "fly"),
        (("domain", "panda", "--colour", "red", "-o", "x.npz"), "--colour"),
    ],
)
def test_wrong_input_ends_with_one_sentence(run, tmp_path, monkeypatch, words, found):
    """Exit code 2, a message that names what is wrong, no traceback, and no file."""
    monkeypatch.chdir(tmp_path)
    code, _, err = run(*words)
    assert code == 2
    assert found in err
    assert "Traceback" not in err
    assert list(tmp_path.iterdir()) == []


def test_damaged_marker_file_is_named(run, tmp_path):
    """A marker file that is no JSON object is refused before any work."""
    markers = tmp_path / "markers.json"
    for text in ("{", "[1, 2]", '{"a":' * 40_000):
        markers.write_text(text)
        words = ("transfer", shipped_recording("ladder"), "-o", tmp_path / "out", "--markers", markers)
        code, _, err = run(*words)
        assert code == 2
        assert "markers.json" in err


def test_folder_with_other_things_is_refused_at_once(run, tmp_path):
    """The folder is looked at before the recording is even read."""
    (tmp_path / "notes.txt").write_text("mine")
    code, _, err = run("transfer", "missing.bvh", "-o", tmp_path)
    assert code == 2
    assert "notes.txt" in err


@pytest.mark.parametrize("verb", ["demo", "transfer", "learn", "track", "place", "reproduce"])
def test_an_earlier_result_stays_unless_it_may_be_overwritten(run, tmp_path, verb):
    """Before any file is read: exit code 2, a sentence that names what is there and the option, nothing touched."""
    own = {"learn": "path.npz", "place": "path.npz", "reproduce": "toy.md"}.get(verb, "joints.csv")
    (tmp_path / own).write_text("earlier")
    inputs = {
        "demo": (), "transfer": ("no.bvh",), "learn": ("no.bvh",), "track": ("no.npz",),
        "place": ("no.npz", "--path", "no.npz"), "reproduce": ("toy",),
    }  # fmt: skip
    code, _, err = run(verb, *inputs[verb], "-o", tmp_path)
    assert code == 2
    assert f"holds an earlier result ('{own}'); give --overwrite" in err
    assert (tmp_path / own).read_text() == "earlier"
    (tmp_path / "notes.txt").write_text("mine")
    code, _, err = run(verb, *inputs[verb], "-o", tmp_path, "--overwrite")
    assert code == 2
    assert "holds other things ('notes.txt')" in err


def test_track_writes_the_joint_trajectory(run, tmp_path):
    """`track` ends with a folder that holds joints.csv, and with its numbers; a profile without times is refused."""
    panda = load_arm("panda")
    joints = np.linspace([0.0, -0.5, 0.0, -2.0, 0.0, 1.8, 0.0], [0.3, -0.4, 0.1, -1.8, 0.1, 1.7, 0.0], 11)
    time = np.linspace(0.0, 1.0, 11)
    save_ellipsoids(tmp_path / "p.npz", panda.manipulability(joints), time)
    save_path(tmp_path / "h.npz", panda.forward(joints)[:, :3, 3], time)
    words = ("track", tmp_path / "p.npz", "--path", tmp_path / "h.npz", "--tempo", 0.5, "--json")
    code, out, _ = run(*words, "-o", tmp_path / "out")
    assert code == 0
    assert json.loads(out)["motion"]["distance"]["p95"] < 0.05
    assert (tmp_path / "out" / "joints.csv").read_text().startswith("time_s,panda_joint1_rad")
    save_ellipsoids(tmp_path / "q.npz", panda.manipulability(joints))
    code, _, err = run("track", tmp_path / "q.npz", "-o", tmp_path / "other")
    assert code == 2
    assert "no times" in err
    save_ellipsoids(tmp_path / "q.npz", panda.manipulability(joints[:1]), time[:1])
    code, _, err = run("track", tmp_path / "q.npz", "-o", tmp_path / "other")
    assert (code, "q.npz' must have shape (n,) with n ≥ 2" in err) == (2, True)


def test_place_tells_the_places_and_writes_the_first(run, tmp_path):
    """`place` prints the ranking and writes what `track` takes; the path lies in the workspace, above the table."""
    panda = load_arm("panda")
    joints = np.linspace([0.0, -0.5, 0.0, -2.0, 0.0, 1.8, 0.0], [0.3, -0.4, 0.1, -1.8, 0.1, 1.7, 0.0], 11)
    save_ellipsoids(tmp_path / "p.npz", panda.manipulability(joints), np.linspace(0.0, 1.0, 11))
    save_path(tmp_path / "h.npz", panda.forward(joints)[:, :3, 3])
    words = ("place", tmp_path / "p.npz", "--path", tmp_path / "h.npz", "-o", tmp_path / "out", "--table", 0.0)
    with few_places():
        code, out, err = run(*words, "--workspace", 0.2, "inf", -0.3, 0.3, "-inf", "inf", "--json")
    assert code == 0, err
    ranking = json.loads(out)["placement"]["candidates"]
    assert [*ranking[0]["distance"]] == ["median", "p95", "max", "rms"]
    assert [one["rank"] for one in ranking] == [1, 2]
    with few_places():
        code, out, err = run(*words[:5], tmp_path / "second", *words[6:], "--rank", 2, "--json")
    assert code == 0, err
    path, time = load_path(tmp_path / "out" / "path.npz")
    assert np.all(path >= np.array([0.2, -0.3, 0.0]) - 1e-8)
    assert path[:, 1].max() <= 0.3 + 1e-8
    np.testing.assert_array_equal(time, load_ellipsoids(tmp_path / "out" / "placed_profile.npz")[1])


def test_evaluate_prints_the_page_and_writes_it(run, domains):
    """`evaluate` measures an adapter beside the alternatives and writes the page, or the numbers."""
    adapter, profile = domains / "a.npz", domains / "profile.npz"
    assert run("fit", domains / "myoarm.npz", domains / "panda.npz", "-o", adapter)[0] == 0
    save_ellipsoids(profile, load_ellipsoids(domains / "myoarm.npz")[0][:12])
    words = ("evaluate", adapter, domains / "myoarm.npz", domains / "panda.npz", profile)
    code, out, _ = run(*words, "-o", domains / "page.md")
    assert code == 0
    assert "raw-copy" in out
    assert (domains / "page.md").read_text().strip() == out.strip()
    assert run(*words, "-o", domains / "page.json", "--quiet")[:2] == (0, "")
    assert json.loads((domains / "page.json").read_text())
    code, _, err = run(*words, "-o", domains / "page.txt")
    assert code == 2
    assert ".md or .json" in err


def test_reproduce_refuses_what_it_does_not_know(run, tmp_path):
    """An unknown experiment is answered with those there are."""
    code, _, err = run("reproduce", "three-dof", "-o", tmp_path / "out")
    assert code == 2
    assert "two-dof" in err


def test_a_demo_that_there_is_not_is_answered_with_those_there_are(run, tmp_path):
    """Before any work, and without a folder."""
    code, _, err = run("demo", "stairs", "-o", tmp_path / "out")
    assert code == 2
    assert "'freeform'" in err
    assert list(tmp_path.iterdir()) == []


def test_help_shows_an_example(run):
    """Every verb's help ends with an example."""
    for verb in cli.ORDER:
        code, out, _ = run(verb, "--help")
        assert code == 0
        assert f"Example: maniport {verb}" in out


def test_interruption_leaves_nothing_behind(tmp_path):
    """Ctrl-C in the middle of the demo: exit code 130, one sentence, and an empty folder."""
    command = [sys.executable, "-m", "maniport", "demo", "-o", str(tmp_path / "out")]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    for line in process.stderr:
        if "sample the person's domain" in line:
            break
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=300)
    assert process.returncode == 130
    assert "interrupted" in err
    assert "Traceback" not in err
    assert list(tmp_path.iterdir()) == []


def test_importing_the_package_loads_nothing_heavy():
    """`import maniport` alone brings in none of the large libraries."""
    code = (
        "import sys, maniport; heavy = {'numba', 'pinocchio', 'scipy', 'sklearn', 'matplotlib', 'numpy'}; "
        "print(sorted(heavy & set(sys.modules)))"
    )
    assert subprocess.check_output([sys.executable, "-c", code], text=True).strip() == "[]"


def test_all_public_names_exist():
    """Every name in `maniport.__all__` can be reached."""
    import maniport

    assert [name for name in maniport.__all__ if getattr(maniport, name, None) is None] == []
    assert {*maniport.__all__} == {"__version__", *maniport._HOMES, *maniport._ROOMS}
