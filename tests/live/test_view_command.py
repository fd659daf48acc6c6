"""The command `maniport view`: it starts, prints where, and ends with Ctrl-C."""

import json
import signal
import subprocess
import sys
import urllib.request

import pytest

pytest.importorskip("viser")


def run(*words):
    """Run the command line in a process of its own, to its end."""
    return subprocess.run(
        [sys.executable, "-m", "maniport", "view", *words], capture_output=True, text=True, timeout=120
    )


def test_it_starts_and_ends_with_ctrl_c(tmp_path):
    """It prints the address of a page that answers; Ctrl-C ends it with exit code 0 and no traceback."""
    command = [sys.executable, "-m", "maniport", "view", "--person", "rhuman", "--port", "0", "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path) as view:
        url = json.loads(view.stdout.readline())["url"]
        assert url.startswith("http://127.0.0.1:")
        with urllib.request.urlopen(url, timeout=10) as answer:
            assert answer.status == 200
        view.send_signal(signal.SIGINT)
        out, err = view.communicate(timeout=30)
    assert view.returncode == 0
    assert "Traceback" not in out + err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--person", "nobody"], "person must be one of 'myoarm', 'rhuman'"),
        (["--robot", "nothing"], "no robot named 'nothing'"),
        (["--port", "99999"], "port must be at most 65535"),
        (["--adapter", "missing.npz"], "missing.npz"),
        (["--recording", "missing.bvh"], "missing.bvh"),
    ],
)
def test_bad_words_end_with_one_sentence(words, told):
    """What cannot be used is told before anything is listened to, with exit code 2."""
    done = run(*words)
    assert done.returncode == 2
    assert told in done.stderr
    assert "Traceback" not in done.stderr
    assert done.stdout == ""
