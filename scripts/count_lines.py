"""Count lines, files and constants of the package, lines of tests and words of pages; list what is over the limits.

Usage: python scripts/count_lines.py [FOLDER]
"""

import ast
import statistics
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "src" / "maniport"

LONGEST_FILE = 320
"""Largest number of lines of a file."""

LONGEST_FUNCTION = 80
"""Largest number of lines of a function from its first decorator to its end, without its docstring."""


def too_long(folder: Path) -> Iterator[str]:
    """Name every file and function of a folder's Python code that is over the limits."""
    for file in sorted(folder.rglob("*.py")):
        text = file.read_text(encoding="utf-8")
        place = file.relative_to(folder)
        if (count := len(text.splitlines())) > LONGEST_FILE:
            yield f"{place}: {count} lines"
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                first = min([node.lineno, *(line.lineno for line in node.decorator_list)])
                doc = node.body[0] if ast.get_docstring(node, clean=False) is not None else None
                count = (
                    node.end_lineno - first + 1 - (doc.end_lineno - doc.lineno + 1 if doc else 0)
                )
                if count > LONGEST_FUNCTION:
                    yield f"{place}: {node.name} has {count} lines"


def constants(folder: Path) -> int:
    """Count upper-case names that are assigned at module level."""
    count = 0
    for file in folder.rglob("*.py"):
        for node in ast.parse(file.read_text(encoding="utf-8")).body:
            for target in (
                node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
            ):
                names = target.elts if isinstance(target, ast.Tuple) else [target]
                count += sum(isinstance(name, ast.Name) and name.id.isupper() for name in names)
    return count


def words(*pages: Path) -> int:
    """Count words: what has a letter or a digit, so no lines of tables."""
    return sum(
        any(map(str.isalnum, word))
        for page in pages
        for word in page.read_text(encoding="utf-8").split()
    )


def main(folder: Path) -> int:
    """Print the counts of each package; 1 when something is over a limit."""
    counts = {
        file: len(file.read_text(encoding="utf-8").splitlines()) for file in folder.rglob("*.py")
    }
    packages: dict[str, list[int]] = {}
    for file, count in counts.items():
        packages.setdefault(file.relative_to(folder).parts[0], []).append(count)
    for package in sorted(packages):
        print(f"{sum(packages[package]):6d} lines {len(packages[package]):4d} files  {package}")
    print(
        f"{sum(counts.values()):6d} lines {len(counts):4d} files, median {statistics.median(counts.values()):g} lines"
    )
    print(f"{constants(folder):6d} module constants")
    tests = sum(
        len(file.read_text(encoding="utf-8").splitlines())
        for file in (ROOT / "tests").rglob("*.py")
    )
    print(f"{tests:6d} lines of tests")
    print(
        f"{words(ROOT / 'README.md'):6d} words of README.md, {words(*(ROOT / 'docs').rglob('*.md'))} of docs"
    )
    exceeded = list(too_long(folder))
    print("\n".join(["over the limits:", *exceeded]) if exceeded else "nothing is over the limits")
    return int(bool(exceeded))


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]) if len(sys.argv) > 1 else PACKAGE))
