"""Output of every verb: in a pipe, as JSON and with --quiet."""

import json
import sys
from contextlib import redirect_stderr, redirect_stdout
from io import BytesIO, TextIOWrapper
from unittest import mock

import pytest

from maniport import cli, load_arm, sample_domain
from maniport.mocap import read_recording, shipped_recording
from maniport.util.files import save_ellipsoids
from sizes import little_search, panda_profile

LIGHT = {
    "domain": "domain panda -n 64 -o {tmp}/more.npz",
    "fit": "fit {tmp}/myoarm.npz {tmp}/panda.npz -o {tmp}/adapter.npz",
    "apply": "apply {tmp}/adapter.npz {tmp}/profile.npz -o {tmp}/adapted.npz",
    "info": "info {tmp}/adapter.npz",
    "evaluate": "evaluate {tmp}/adapter.npz {tmp}/myoarm.npz {tmp}/panda.npz {tmp}/profile.npz",
}
HEAVY = {
    "compile": "compile",
    "demo": "demo --n-teacher 64 --n-student 128 -o {tmp}/demo --overwrite",
    "figures": "figures {tmp}/demo -o {tmp}/figures",
    "learn": "learn {recording} --segments 1.4:2,2.5:3 --components 2 --robot panda --method identity "
    "--no-move -o {tmp}/learned --overwrite",
}
TESTED_ELSEWHERE = {"audit", "batch", "live", "place", "reproduce", "track", "transfer", "view"}
MISTAKE = "info pnda"


def call(words, encoding="utf-8"):
    """Call the command line with streams of an encoding; return exit code, standard output and standard error."""
    streams = [TextIOWrapper(BytesIO(), encoding=encoding) for _ in range(2)]
    with (
        redirect_stdout(streams[0]),
        redirect_stderr(streams[1]),
        pytest.raises(SystemExit) as stop,
        mock.patch.object(sys, "argv", ["maniport", *words]),
    ):
        cli.main()
    texts = []
    for stream in streams:
        stream.flush()
        texts.append(stream.buffer.getvalue().decode(encoding))
    return int(stop.value.code or 0), *texts


@pytest.fixture(scope="module")
def piped(tmp_path_factory):
    """Exit code, standard output and standard error by mode and verb, in an order in which each finds its files."""
    tmp = tmp_path_factory.mktemp("output")
    for name in ("myoarm", "panda"):
        save_ellipsoids(tmp / f"{name}.npz", sample_domain(load_arm(name), 64, 0))
    _, time, _, ellipsoids, _ = panda_profile()
    save_ellipsoids(tmp / "profile.npz", ellipsoids, time)
    short = read_recording("freeform").crop(2.0, 2.2)
    file = shipped_recording("freeform")
    lines = {
        verb: line.format(tmp=tmp, recording=file).split()
        for verb, line in {**LIGHT, **HEAVY, "mistake": MISTAKE}.items()
    }

    def read(source, **options):
        return short if source == "freeform" else read_recording(source, **options)

    with little_search(), mock.patch("maniport.pipeline.settings.read_recording", read):
        results = {("json", verb): call([*words, "--json"]) for verb, words in lines.items()}
    results |= {("lines", verb): call(lines[verb]) for verb in LIGHT}
    return (
        results
        | {
            ("quiet", verb): call([*lines[verb], "--quiet"])
            for verb in ("domain", "fit", "mistake")
        }
        | {
            ("ascii", "fit"): call(lines["fit"], "ascii"),
            ("ascii json", "apply"): call([*lines["apply"], "--json"], "ascii"),
        }
    )


def test_every_verb_is_tested():
    names = {command.callback.__name__ for command in cli.app.registered_commands}
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
