"""The cache of compiled functions: damaged, stale, full or without a folder, it costs a compilation."""

import errno
import importlib
import sys

import numpy as np
import pytest
from numba.core.caching import IndexDataCacheFile

from maniport.util import jit
from maniport.util.compiling import watched

CALLED = "from maniport.util.jit import part\n@part\ndef scale():\n    return {}\n"
CALLER = (
    "from maniport.util.jit import kernel\nfrom called import scale\n"
    "@kernel\ndef scaled(x):\n    return scale() * x\n"
)


@pytest.fixture
def imported(tmp_path, monkeypatch):
    """Return a function that imports a kernel anew, as another process would."""
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr("numba.config.CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    (tmp_path / "called.py").write_text(CALLED.format(2.0))
    (tmp_path / "caller.py").write_text(CALLER)

    def imported():
        for name in ("called", "caller"):
            monkeypatch.delitem(sys.modules, name, raising=False)
        importlib.invalidate_caches()
        return importlib.import_module("caller").scaled

    yield imported
    for name in ("called", "caller"):
        sys.modules.pop(name, None)


def hits(kernel):
    return sum(kernel.stats.cache_hits.values())


def test_compiled_functions_are_cached_until_their_code_changes(imported, tmp_path):
    for expected in (0, 1):
        kernel = imported()
        assert (kernel(1.5), hits(kernel)) == (3.0, expected)
    (tmp_path / "called.py").write_text(CALLED.format(4.0))
    kernel = imported()
    assert (kernel(1.5), hits(kernel)) == (6.0, 0)


@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
@pytest.mark.parametrize("damage", ["emptied", "cut", "overwritten", "a folder"])
def test_a_damaged_cache_costs_a_compilation(imported, tmp_path, suffix, damage):
    imported()(1.5)
    (file,) = tmp_path.rglob(f"*.{suffix}")
    content = file.read_bytes()
    if damage == "a folder":
        file.unlink()
        file.mkdir()
    else:
        noise = np.random.default_rng(0).bytes(len(content))
        file.write_bytes({"emptied": b"", "cut": content[:-9], "overwritten": noise}[damage])
    kernel = imported()
    assert (kernel(1.5), hits(kernel)) == (3.0, 0)


@pytest.mark.parametrize(
    "fault", [OSError(errno.ENOSPC, "full"), OSError(errno.EROFS, "read-only"), RuntimeError()]
)
def test_a_cache_that_cannot_be_written_costs_only_the_cache(imported, monkeypatch, fault):
    def fail(*_):
        raise fault

    where = (
        (jit._Cache, "__init__")
        if isinstance(fault, RuntimeError)
        else (IndexDataCacheFile, "_open_for_write")
    )
    monkeypatch.setattr(*where, fail)
    assert imported()(1.5) == 3.0


def test_only_compiling_is_announced(imported):
    for expected in ([True, False], []):
        announced = []
        kernel = imported()
        with watched(announced.append):
            kernel(1.5)
        assert announced == expected
