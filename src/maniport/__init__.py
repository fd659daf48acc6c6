"""maniport: transfer manipulability from a human arm to a robot arm.

The public names are those of the stub ``__init__.pyi``, loaded on first use, so that ``import maniport`` stays light.
"""

import ast
import importlib
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from maniport.util.notebook import render_with


def names_of_stub(package: str, file: str) -> tuple[list[str], Callable[[str], Any]]:
    """Return `__all__` and `__getattr__` of a package, which load the names that its stub imports on first use."""
    stub = ast.parse(Path(file).with_suffix(".pyi").read_text(encoding="utf-8"))
    imports = [node for node in stub.body if isinstance(node, ast.ImportFrom)]
    modules = {alias.name: node.module for node in imports for alias in node.names if alias.asname}

    def load(name: str) -> Any:
        if name not in modules:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        is_module = modules[name] == package
        value = importlib.import_module(f"{package}.{name}" if is_module else str(modules[name]))
        setattr(sys.modules[package], name, value if is_module else getattr(value, name))
        return getattr(sys.modules[package], name)

    return sorted(modules), load


__all__, __getattr__ = names_of_stub(__name__, __file__)


def __dir__() -> list[str]:
    return __all__


def _markdown(value: object) -> str:
    """Return the Markdown that a notebook displays; the report is loaded on first use."""
    from maniport.report import as_markdown, report_of

    return as_markdown(report_of(value), details=True)


render_with(_markdown)
