"""What every verb prints: into a pipe, to a terminal, as JSON, with --quiet and with NO_COLOR."""

import json
import os
import pty
import re
import subprocess
import sys

import numpy as np
import pytest

from maniport import load_arm
from maniport.cli import app
from maniport.files import save_ellipsoids, save_path

RUNNER = '''
"""Run the command line many times in one process, each time between two marks on both streams."""
import dataclasses, json, os, sys
from maniport import cli, demonstrations
from maniport.pipeline import job as pipeline
from maniport.tracking import effort
from maniport.tracking.plan import reachability_map

a_moment = demonstrations.read_recording(demonstrations.shipped_recording("freeform")).crop(2.0, 2.2)
demonstrations.shipped_recording = lambda name: a_moment  # the demo runs in no time
pipeline.transfer_recording.__kwdefaults__.update(n_teacher=64, n_student=128)
few = {"candidates": 64, "placement_nodes": 24, "nodes": 60}
effort.EFFORTS["full"] = dataclasses.replace(effort.EFFORTS["full"], **few)
reachability_map.SAMPLES = 2000

for environment, words in json.loads(sys.argv[1]):
    os.environ.update(environment)
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
    "place": "place {tmp}/profile.npz --path {tmp}/hand.npz -o {tmp}/placed --overwrite",
    "track": "track {tmp}/profile.npz -o {tmp}/motion --overwrite",
    "figures": "figures {tmp}/motion -o {tmp}/figures",
    "evaluate": "evaluate {tmp}/adapter.npz {tmp}/myoarm.npz {tmp}/panda.npz {tmp}/profile.npz",
}
HEAVY = {
    "transfer": "transfer {recording} --start 2 --stop 2.2 --no-move --method raw-copy -o {tmp}/to --overwrite",
    "learn": "learn {recording} --segments 1.4:2,2.5:3 --components 2 --robot panda --method raw-copy "
    "-o {tmp}/learned --overwrite",
    "batch": "batch {recording} --start 2 --stop 2.2 --robot panda --no-move --method raw-copy "
    "-o {tmp}/dataset --overwrite",
    "demo": "demo -o {tmp}/demo --overwrite",
    "reproduce": "reproduce toy -o {tmp}/paper --overwrite",
}
MISTAKE = "info pnda"
SAMPLES = ("domain", "fit", "info")
"""Verbs that stand for all where options do the same for every one; fit has steps."""
LIVE = ("live", "view")
"""Verbs that go on until they are stopped; they have tests of their own."""

COLOURS = re.compile(r"\x1b\[(?:[\d;]*;)?(?:3\d|4[0-8]|9\d|10\d)(?:;[\d;]*)?m")
PLAIN, NO_COLOUR = {}, {"NO_COLOR": "1"}


@pytest.fixture(scope="module")
def verbs(tmp_path_factory):
    """The words of each verb, with files for them; the verbs come in an order in which each finds its files."""
    from maniport import sample_domain
    from maniport.demonstrations import shipped_recording

    tmp, panda = tmp_path_factory.mktemp("output"), load_arm("panda")
    for name in ("myoarm", "panda"):
        save_ellipsoids(tmp / f"{name}.npz", sample_domain(load_arm(name), 64, 0))
    joints = np.linspace([0.0, -0.5, 0.0, -2.0, 0.0, 1.8, 0.0], [0.3, -0.4, 0.1, -1.8, 0.1, 1.7, 0.0], 11)
    save_ellipsoids(tmp / "profile.npz", panda.manipulability(joints), np.linspace(0.0, 1.0, 11))
    save_path(tmp / "hand.npz", panda.forward(joints)[:, :3, 3])
    places = {"tmp": tmp, "recording": shipped_recording("freeform")}
    lines = {**LIGHT, **HEAVY, "mistake": MISTAKE}
    return {verb: [word.format(**places) for word in line.split()] for verb, line in lines.items()}


@pytest.fixture(scope="module")
def piped(verbs):
    """Exit code, standard output and standard error of every verb in a pipe, by mode and verb."""
    modes = {"lines": [], "forced": [], "quiet": ["--quiet"], "json": ["--json"], "both": ["--json", "--quiet"]}
    several = {"json": verbs, "forced": ("fit",), "quiet": (*SAMPLES, "mistake")}
    runs = [(mode, verb) for mode in modes for verb in several.get(mode, SAMPLES)]
    plan = [[{"FORCE_COLOR": "1"} if mode == "forced" else {}, verbs[verb] + modes[mode]] for mode, verb in runs]
    command = [sys.executable, "-c", RUNNER, json.dumps(plan)]
    result = subprocess.run(command, capture_output=True, encoding="utf-8", timeout=300, check=True)
    streams = [re.split(r"\n=== (\d+)\n", text) for text in (result.stdout, result.stderr)]
    codes = streams[0][1::2]
    return {
        run: (int(code), out, err)
        for run, code, out, err in zip(runs, codes, *(parts[:-1:2] for parts in streams), strict=True)
    }


@pytest.fixture(scope="module")
def terminal(verbs):
    """Exit code and everything that a terminal gets of some verbs, by mode and verb."""
    modes = {"colours": PLAIN, "no colours": NO_COLOUR}
    runs = [("colours", "fit"), *(("no colours", verb) for verb in SAMPLES)]
    plan = [[modes[mode], verbs[verb]] for mode, verb in runs]
    text = on_a_terminal([sys.executable, "-c", RUNNER, json.dumps(plan)])
    parts = re.split(r"\n=== (\d+)\n", text.replace("\r\n", "\n"))
    # both streams end at one terminal, so that each verb leaves two marks
    return {run: (int(parts[4 * i + 1]), parts[4 * i]) for i, run in enumerate(runs)}


def on_a_terminal(command):
    """Run a command on a pseudo-terminal and return what it writes there."""
    ours, theirs = pty.openpty()
    environment = {k: v for k, v in os.environ.items() if k not in ("NO_COLOR", "FORCE_COLOR", "CI")}
    environment |= {"TERM": "xterm-256color", "COLUMNS": "100", "LINES": "40"}
    process = subprocess.Popen(command, stdin=theirs, stdout=theirs, stderr=theirs, env=environment)
    os.close(theirs)
    chunks = []
    while True:
        try:
            chunk = os.read(ours, 65536)
        except OSError:  # Linux says so when the other side is closed
            break
        if not chunk:
            break
        chunks.append(chunk)
    os.close(ours)
    assert process.wait(timeout=300) == 0
    return b"".join(chunks).decode("utf-8")


def test_every_verb_is_looked_at():
    """A new verb has to be added to this file."""
    assert {command.callback.__name__ for command in app.registered_commands} - {*LIVE} == {*LIGHT, *HEAVY}


@pytest.mark.parametrize("verb", [*LIGHT, *HEAVY])
def test_json_is_one_object_and_nothing_else(piped, verb):
    """With --json, standard output holds one JSON object, strictly, and standard error nothing."""

    def refuse(constant):
        raise AssertionError(f"{constant} is no JSON")

    code, out, err = piped["json", verb]
    assert (code, err) == (0, "")
    assert len(out.splitlines()) == 1
    assert isinstance(json.loads(out, parse_constant=refuse), dict)


@pytest.mark.parametrize("verb", SAMPLES)
def test_quiet_prints_nothing_but_what_json_asks_for(piped, verb):
    """With --quiet both streams stay empty; with --json as well there is the object alone."""
    assert piped["quiet", verb] == (0, "", "")
    code, out, err = piped["both", verb]
    assert (code, err) == (0, "")
    assert isinstance(json.loads(out), dict)


@pytest.mark.parametrize("verb", SAMPLES)
def test_a_pipe_gets_plain_lines(piped, verb):
    """Results come on standard output, steps as whole lines on standard error; no bar and no escape sequence."""
    code, out, err = piped["lines", verb]
    assert code == 0
    assert out.strip()
    assert not set("━\r\x1b") & set(out + err)
    assert all(line[0] in "✓!" for line in err.splitlines())
    assert bool(err) == (verb == "fit")


def test_colours_can_be_forced_but_no_bar(piped):
    """With FORCE_COLOR, which many build servers set, a pipe still gets no bar and keeps its cursor."""
    code, _, err = piped["forced", "fit"]
    assert code == 0
    assert "✓" in err
    assert not set("━\r") & set(err)
    assert "\x1b[?25l" not in err


def test_a_terminal_gets_a_bar_with_colours(terminal):
    """On a terminal a bar shows what goes on; it is gone at the end, and the cursor is back."""
    code, text = terminal["colours", "fit"]
    assert code == 0
    assert "━" in text
    assert COLOURS.search(text)
    assert text.count("\x1b[?25l") == text.count("\x1b[?25h") > 0
    assert "✓" in text


@pytest.mark.parametrize("verb", SAMPLES)
def test_no_color_leaves_no_colours(terminal, verb):
    """With NO_COLOR (https://no-color.org) a terminal gets no colour code from any verb."""
    code, text = terminal["no colours", verb]
    assert code == 0
    assert text.strip()
    assert not COLOURS.search(text)


def test_an_alphabet_without_our_signs_does_no_harm(verbs):
    """Where the streams can write ASCII alone, signs become question marks, and JSON escapes them."""
    environment = {**os.environ, "PYTHONIOENCODING": "ascii"}
    plan = json.dumps([[{}, verbs["fit"]], [{}, [*verbs["apply"], "--json"]]])
    command = [sys.executable, "-c", RUNNER, plan]
    result = subprocess.run(command, capture_output=True, env=environment, timeout=300, check=True)
    assert b"? fit the adapter" in result.stderr
    fitted, applied, _ = re.split(r"\n=== 0\n", result.stdout.decode("ascii"))
    assert "adapter ? " in fitted
    assert json.loads(applied)["ellipsoids"] == 11


@pytest.mark.parametrize("mode", ["json", "quiet"])
def test_errors_are_told_on_standard_error_alone(piped, mode):
    """A mistake ends with exit code 2 and a sentence on standard error, whatever is asked for."""
    code, out, err = piped[mode, "mistake"]
    assert (code, out) == (2, "")
    assert "'panda'" in err
