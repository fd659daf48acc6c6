"""Files and functions keep to sizes that fit in the head."""

import runpy
from pathlib import Path

COUNT = runpy.run_path(str(Path(__file__).parent.parent / "scripts" / "count_lines.py"))


def test_no_file_and_no_function_is_too_long():
    """Files of the package have at most 320 lines, functions at most 80 without docstring."""
    assert list(COUNT["too_long"](COUNT["PACKAGE"])) == []
