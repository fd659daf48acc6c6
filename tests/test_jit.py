"""The cache of compiled functions: damaged, stale, full or without a folder, it costs a compilation."""

import errno
import importlib
import sys

import numpy as np
import pytest
from numba.core.caching import IndexDataCacheFile

from maniport import jit

CALLED = "from maniport.jit import part\n@part\ndef scale():\n    return {}\n"
CALLER = "from maniport.jit import kernel\nfrom called import scale\n@kernel\ndef scaled(x):\n    return scale() * x\n"


@pytest.fixture
def compiled(tmp_path, monkeypatch):
    """Return a function that imports a kernel anew, as another process would; its cache is beside it."""
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    (tmp_path / "called.py").write_text(CALLED.format(2.0))
    (tmp_path / "caller.py").write_text(CALLER)

    def compiled():
        for name in ("called", "caller"):
            monkeypatch.delitem(sys.modules, name, raising=False)
        importlib.invalidate_caches()
        return importlib.import_module("caller").scaled

    yield compiled
    for name in ("called", "caller"):
        sys.modules.pop(name, None)


def hits(kernel):
    """How often a compiled function came out of the cache."""
    return sum(kernel.stats.cache_hits.values())


def test_a_compiled_function_is_loaded_the_next_time(compiled):
    """The second time nothing is compiled."""
    for expected in (0, 1):
        kernel = compiled()
        assert (kernel(1.5), hits(kernel)) == (3.0, expected)


def test_a_change_of_a_called_function_in_another_file_is_noticed(compiled, tmp_path):
    """The caller is compiled again."""
    compiled()(1.5)
    (tmp_path / "called.py").write_text(CALLED.format(4.0))
    kernel = compiled()
    assert (kernel(1.5), hits(kernel)) == (6.0, 0)


@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
@pytest.mark.parametrize("damage", ["emptied", "cut", "overwritten", "a folder"])
def test_a_damaged_cache_costs_a_compilation(compiled, tmp_path, suffix, damage):
    """The result is right, and the next process has its cache again."""
    compiled()(1.5)
    (file,) = tmp_path.rglob(f"*.{suffix}")
    content = file.read_bytes()
    if damage == "a folder":
        file.unlink()
        file.mkdir()
    else:
        noise = np.random.default_rng(0).bytes(len(content))
        file.write_bytes({"emptied": b"", "cut": content[:-9], "overwritten": noise}[damage])
    kernel = compiled()
    assert (kernel(1.5), hits(kernel)) == (3.0, 0)
    kernel = compiled()
    assert (kernel(1.5), hits(kernel)) == (3.0, 0 if damage == "a folder" else 1)


def test_code_for_other_arguments_is_not_run(compiled, tmp_path):
    """Two processes that fill the cache at once can leave it in a file of another name."""
    kernel = compiled()
    assert (kernel(1.5), kernel(np.ones(2)).tolist()) == (3.0, [2.0, 2.0])
    one, other = sorted(tmp_path.rglob("*.nbc"))
    other.write_bytes(one.read_bytes())
    kernel = compiled()
    assert (kernel(1.5), kernel(np.ones(2)).tolist()) == (3.0, [2.0, 2.0])


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EROFS])
def test_a_full_or_read_only_disk_costs_the_cache_alone(compiled, monkeypatch, number):
    """The function is compiled and works."""

    def fail(self, path):
        raise OSError(number, "not written")

    monkeypatch.setattr(IndexDataCacheFile, "_open_for_write", fail)
    assert compiled()(1.5) == 3.0


def test_without_a_folder_there_is_no_cache(compiled, monkeypatch):
    """Where nothing can be written at all, everything works."""

    def fail(self, function):
        raise RuntimeError("cannot cache function 'scaled': no locator available")

    monkeypatch.setattr(jit._Cache, "__init__", fail)
    assert compiled()(1.5) == 3.0
