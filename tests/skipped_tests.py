"""Two environment variables that let ``.ci/run`` repeat what a first run skipped, with all that those tests need.

MANIPORT_SKIPPED names a file, to which the names of skipped tests are written, one a line. With MANIPORT_NEEDS_ALL a
skipped test is an error.
"""

import os
from pathlib import Path

_skipped = dict[str, None]()  # names of tests, or of files that were skipped as a whole


def _collect(report):
    if report.skipped and not hasattr(report, "wasxfail"):
        _skipped[report.nodeid] = None


pytest_runtest_logreport = _collect
pytest_collectreport = _collect


def pytest_sessionfinish(session):
    if hasattr(session.config, "workerinput"):
        return  # reports of workers come together in the main process
    if os.environ.get("MANIPORT_SKIPPED"):
        file = Path(os.environ["MANIPORT_SKIPPED"])
        file.write_text("".join(f"{name}\n" for name in _skipped), encoding="utf-8")
    if os.environ.get("MANIPORT_NEEDS_ALL") and _skipped and not session.exitstatus:
        session.exitstatus = 1


def pytest_terminal_summary(terminalreporter):
    if os.environ.get("MANIPORT_NEEDS_ALL") and _skipped:
        terminalreporter.section("skipped tests are errors here", red=True)
        for name in _skipped:
            terminalreporter.write_line(name)
