"""Names of a package that are loaded on first use."""

import ast
import importlib
import sys
from collections.abc import Callable
from pathlib import Path


def names_of_stub(package: str, file: str) -> tuple[list[str], Callable[[str], object]]:
    """Return `__all__` and `__getattr__` of a package, which load the names that its stub imports on first use."""
    stub = ast.parse(Path(file).with_suffix(".pyi").read_text(encoding="utf-8"))
    imports = [node for node in stub.body if isinstance(node, ast.ImportFrom)]
    modules = {}
    for node in imports:
        for alias in node.names:
            if alias.asname:
                modules[alias.name] = node.module

    def load(name: str) -> object:
        if name not in modules:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        is_module = modules[name] == package
        value = importlib.import_module(f"{package}.{name}" if is_module else str(modules[name]))
        setattr(sys.modules[package], name, value if is_module else getattr(value, name))
        return getattr(sys.modules[package], name)

    return sorted(modules), load
