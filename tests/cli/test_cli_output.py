"""Output of every verb: in a pipe, as JSON and with --quiet."""

import json
import re
import subprocess
import sys

import pytest

from maniport import load_arm, sample_domain
from maniport.cli import app
from maniport.mocap import shipped_recording
from maniport.util.files import save_ellipsoids
from sizes import panda_profile

RUNNER = '''
"""Run the command line many times in one process, each time between two marks on both streams."""
import json, os, sys
from maniport import cli, mocap
from maniport.motion.plan import reachability_map

reachability_map.SAMPLES = 10_000
read = mocap.read_recording
short = read("freeform").crop(2.0, 2.2)
mocap.read_recording = lambda source, **options: short if source == "freeform" else read(source, **options)

for environment, words in json.loads(sys.argv[1]):
    os.environ.update(environment)
    for stream in (sys.stdout, sys.stderr):
        stream.reconfigure(encoding=environment.get("PYTHONIOENCODING", "utf-8"))
    sys.argv = ["maniport", *words]
    code = 0
    try:
        cli.main()
    except SystemExit as stop:
        code = int(stop.code or 0)
    for name in environment:
        del os.environ[name]
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
        stream.write(f"\\n=== {code}\\n")
        stream.flush()
'''

LIGHT = {
    "domain": "domain panda -n 64 -o {tmp}/more.npz",
    "fit": "fit {tmp}/myoarm.npz {tmp}/panda.npz -o {tmp}/adapter.npz",
    "apply": "apply {tmp}/adapter.npz {tmp}/profile.npz -o {tmp}/adapted.npz",
    "info": "info {tmp}/adapter.npz",
    "evaluate": "evaluate {tmp}/adapter.npz {tmp}/myoarm.npz {tmp}/panda.npz {tmp}/profile.npz",
}
HEAVY = {
    "demo": "demo --n-teacher 64 --n-student 128 -o {tmp}/demo --overwrite",
    "figures": "figures {tmp}/demo -o {tmp}/figures",
    "learn": "learn {recording} --segments 1.4:2,2.5:3 --components 2 -o {tmp}/learned --overwrite",
}
TESTED_ELSEWHERE = {"batch", "live", "place", "reproduce", "track", "transfer", "view"}
MISTAKE = "info pnda"


@pytest.fixture(scope="module")
def verbs(tmp_path_factory):
    """Arguments of each verb, in an order in which each finds its files."""
    tmp = tmp_path_factory.mktemp("output")
    for name in ("myoarm", "panda"):
        save_ellipsoids(tmp / f"{name}.npz", sample_domain(load_arm(name), 64, 0))
    _, time, _, ellipsoids, _ = panda_profile()
    save_ellipsoids(tmp / "profile.npz", ellipsoids, time)
    places = {"tmp": tmp, "recording": shipped_recording("freeform")}
    lines = {**LIGHT, **HEAVY, "mistake": MISTAKE}
    return {verb: [word.format(**places) for word in line.split()] for verb, line in lines.items()}


MODES = {  # options, environment, and verbs if not all
    "lines": ([], {}, LIGHT),
    "quiet": (["--quiet"], {}, ["domain", "fit", "mistake"]),
    "json": (["--json"], {}, [*LIGHT, *HEAVY, "mistake"]),
    "ascii": ([], {"PYTHONIOENCODING": "ascii"}, ["fit"]),
    "ascii json": (["--json"], {"PYTHONIOENCODING": "ascii"}, ["apply"]),
}


@pytest.fixture(scope="module")
def piped(verbs):
    """Exit code, standard output and standard error in a pipe, by mode and verb."""
    runs = [(mode, verb) for mode, (*_, names) in MODES.items() for verb in names]
    plan = [[MODES[mode][1], verbs[verb] + MODES[mode][0]] for mode, verb in runs]
    result = subprocess.run(
        [sys.executable, "-c", RUNNER, json.dumps(plan)], capture_output=True, timeout=300, check=True
    )
    streams = [re.split(r"\n=== (\d+)\n", text.decode()) for text in (result.stdout, result.stderr)]
    out, err = (parts[:-1:2] for parts in streams)
    return dict(zip(runs, zip(map(int, streams[0][1::2]), out, err, strict=True), strict=True))


def test_every_verb_is_tested():
    names = {command.callback.__name__ for command in app.registered_commands}
    assert names == {*LIGHT, *HEAVY, *TESTED_ELSEWHERE}


@pytest.mark.parametrize("verb", [*LIGHT, *HEAVY])
def test_json_is_one_strict_object(piped, verb):
    def refuse(constant):
        raise AssertionError(f"{constant} is no JSON")

    code, out, err = piped["json", verb]
    assert (code, err) == (0, "")
    assert len(out.splitlines()) == 1
    assert isinstance(json.loads(out, parse_constant=refuse), dict)


def test_quiet_prints_nothing_but_errors(piped):
    assert piped["quiet", "domain"] == piped["quiet", "fit"] == (0, "", "")
    for mode in ("json", "quiet"):
        code, out, err = piped[mode, "mistake"]
        assert (code, out, "'panda'" in err) == (2, "", True)


@pytest.mark.parametrize("verb", LIGHT)
def test_a_pipe_gets_plain_lines(piped, verb):
    code, out, err = piped["lines", verb]
    assert code == 0
    assert out.strip()
    assert not set("━\r\x1b") & set(out + err)
    assert all(line[0] in "✓!" or "→" in line for line in err.splitlines())


def test_streams_in_ascii(piped):
    _, fitted, steps = piped["ascii", "fit"]
    assert "? Fit transfer" in steps
    assert "adapter ? " in fitted
    assert json.loads(piped["ascii json", "apply"][1])["ellipsoids"] == 11
