"""Expand a xacro file as a script, in a process with limits of time and memory.

The argument is JSON with the keys ``path``, ``most`` (the largest size of the file and of each included file [bytes]),
``memory`` (the memory limit [bytes]), ``folders`` (of packages) and ``arguments`` (of the file, by name). The standard
output is JSON with the keys ``urdf`` or ``error``, and ``package`` (a package that was not found), ``missing``
(arguments without a value), ``declared`` (all arguments that the file declares or uses) and ``opened`` (SHA-256 of the
content of each file that was read, by its path).
"""

import hashlib
import importlib
import json
import os
import runpy
import stat
import sys
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

PLACEHOLDER = "0"  # value of missing arguments, as a number, a condition and a part of names
PACKAGE_FOLDERS = runpy.run_path(str(Path(__file__).with_name("package_folders.py")))


class Expansion:
    """The expansion of one file, with what is missing."""

    def __init__(self, order: dict[str, Any]):
        self.path: str = order["path"]
        self.most: int = order["most"]
        self.folders = [Path(folder) for folder in order["folders"]]
        self.arguments: dict[str, str] = dict(order["arguments"])
        self.package = ""
        self.missing: list[str] = []
        self.declared: list[str] = []
        self.digests: dict[str, str] = {}

    def urdf(self) -> str:
        """Expand the file to a URDF; missing arguments have a placeholder."""
        xacro: Any = importlib.import_module("xacro")
        substitution: Any = importlib.import_module("xacro.substitution_args")
        importlib.import_module(
            "xacrodoc.xacrodoc"
        )  # replaces functions of xacro, before this does
        read_attributes = xacro.check_attrs

        def attributes(tag: Any, required: list[str], optional: list[str]) -> Any:
            """Return attributes of an element; an argument without default needs a value."""
            if tag.tagName != "xacro:arg" or not tag.hasAttribute("name"):
                return read_attributes(tag, required, optional)
            name = tag.getAttribute("name")
            if tag.hasAttribute("default"):
                self.declared.append(name)
                return read_attributes(tag, required, optional)
            self.value(name)
            return read_attributes(tag, ["name"], ["default"])

        xacro.open = self.opened
        xacro.check_attrs = attributes
        xacro._global_symbols["xacro"]["arg"] = self.value
        substitution._eval_arg = lambda name, args: self.value(name)
        substitution._eval_find = self.find
        substitution._eval_dict["find"] = self.find
        return str(xacro.process_file(self.path, mappings=self.arguments).toxml())

    def value(self, name: str) -> str:
        """Return the value of an argument, a placeholder where it has none."""
        self.declared.append(name)
        if name not in self.arguments:
            self.missing.append(name)
            self.arguments[name] = PLACEHOLDER
        return self.arguments[name]

    def find(self, package: str) -> str:
        """Return the folder of a package."""
        folder = PACKAGE_FOLDERS["find_package"](package, Path(self.path), self.folders)
        if folder is not None:
            return str(folder)
        packages: Any = importlib.import_module("xacrodoc.packages")
        try:
            return str(packages.get_path(package))
        except packages.PackageNotFoundError:
            self.package = package
            raise

    def opened(self, name: str, *args: Any, **options: Any) -> Any:
        """Open a regular file of limited size."""
        status = os.stat(name)
        if not stat.S_ISREG(status.st_mode):
            raise ValueError(f"{name}: this is a pipe, a socket or a device")
        if status.st_size > self.most:
            raise ValueError(f"{name}: has {status.st_size} bytes; at most {self.most} are read")
        with open(name, "rb") as stream:
            self.digests[os.path.abspath(name)] = hashlib.sha256(stream.read()).hexdigest()
        return open(name, *args, **options)


def main() -> None:
    """Write the URDF, or what is wrong."""
    order = json.loads(sys.argv[1])
    try:
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (order["memory"], order["memory"]))
    except (ImportError, ValueError, OSError):  # not on Windows and macOS
        pass
    expansion = Expansion(order)
    answer: dict[str, Any] = {}
    with redirect_stderr(StringIO()), redirect_stdout(StringIO()):  # deprecation warnings of xacro
        try:
            answer["urdf"] = expansion.urdf()
        except Exception as error:  # noqa: BLE001 - xacro files evaluate Python
            answer["error"] = str(error) or type(error).__name__
    answer["package"] = expansion.package
    answer["missing"] = list(dict.fromkeys(expansion.missing))
    answer["declared"] = sorted(set(expansion.declared))
    answer["opened"] = expansion.digests
    sys.stdout.write(json.dumps(answer))


if __name__ == "__main__":
    main()
