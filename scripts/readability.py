"""Measure how densely Python packages are written, and compare them with target values.

Usage: python readability.py [--check] FOLDER [FOLDER ...]

Shows the subfolders of a single folder, too. Counts are per 1 000 statements: a line break changes only "tokens/line".
With --check, a row of the last folder above its target exits with 1.
"""

import ast
import io
import math
import sys
import tokenize
from collections import Counter
from pathlib import Path

# The largest readable value of each row. mink and pyroki meet all, Pink, pyRiemann and toppra all but one.
ROWS = {
    "files": math.inf,
    "code lines": math.inf,
    "statements": math.inf,
    "tokens/line": 8.5,
    "tokens/statement": 13.0,
    "packed assignments": 5.0,  # a, b = x, y where two statements would do the same
    "comprehensions": 40.0,  # the anchors have 12 at most; those of one level read well
    "nested comprehensions": 0.5,
    "conditional expressions": 20.0,
    "nested conditional expressions": 0.5,
    "walrus": 1.0,
    "Any": 5.0,
    "fmt: skip": 0.0,
    "type: ignore": 2.0,
    "> 8 parameters": 4.0,
    "complexity > 12": 2.0,
}
SIZES = ("files", "code lines", "statements", "tokens/line", "tokens/statement")
FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)
COMPREHENSIONS = (ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp)
EXPRESSIONS = {"comprehensions": COMPREHENSIONS, "conditional expressions": ast.IfExp}
BRANCHES = (
    ast.If,
    ast.For,
    ast.While,
    ast.ExceptHandler,
    ast.IfExp,
    ast.match_case,
    ast.comprehension,
)
LAYOUT = {
    tokenize.COMMENT,
    tokenize.NL,
    tokenize.NEWLINE,
    tokenize.INDENT,
    tokenize.DEDENT,
    tokenize.ENDMARKER,
}


def count_tokens(text, counts):
    """Count tokens, the lines on which they begin, and directives; a string is one token, an f-string too."""
    depth = 0  # inside f-strings, which Python 3.12 and later split into tokens
    lines = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        kind = tokenize.tok_name[token.type]
        depth -= kind.endswith("STRING_END")
        if token.type not in LAYOUT and depth == 0 and not kind.endswith("STRING_END"):
            counts["tokens"] += 1
            lines.add(token.start[0])
        depth += kind.endswith("STRING_START")
    counts["fmt: skip"] += text.count("# fmt:")
    counts["type: ignore"] += text.count("# type: ignore")
    counts["code lines"] += len(lines)


def is_packed(node):
    """Whether an assignment of a tuple to a tuple does the same as one statement for each value."""
    if not (isinstance(node, ast.Assign) and isinstance(node.value, ast.Tuple)):
        return False
    names = [ast.unparse(name) for name in getattr(node.targets[0], "elts", ())]
    used = [{ast.unparse(part) for part in ast.walk(value)} for value in node.value.elts]
    return bool(names) and all(
        used[i].isdisjoint(names[:i]) for i in range(len(used))
    )  # not so of a, b = b, a


def complexity(function):
    """Return McCabe's number of a function with its Boolean operators and inner functions."""
    nodes = list(ast.walk(function))
    operators = sum(len(node.values) - 1 for node in nodes if isinstance(node, ast.BoolOp))
    return 1 + operators + sum(isinstance(node, BRANCHES) for node in nodes)


def count_constructs(tree, counts):
    """Count statements without docstrings, and constructs that are hard to read in numbers."""
    for node in ast.walk(tree):
        counts["statements"] += isinstance(node, ast.stmt)
        counts["packed assignments"] += is_packed(node)
        counts["walrus"] += isinstance(node, ast.NamedExpr)
        counts["Any"] += "Any" in (getattr(node, "id", ""), getattr(node, "attr", ""))
        for name, kinds in EXPRESSIONS.items():
            inside = (
                sum(isinstance(part, kinds) for part in ast.walk(node))
                if isinstance(node, kinds)
                else 0
            )
            counts[name] += inside > 0
            counts[f"nested {name}"] += inside > 1
        if isinstance(node, (ast.Module, ast.ClassDef, *FUNCTIONS)):
            counts["statements"] -= ast.get_docstring(node, clean=False) is not None
        if isinstance(node, FUNCTIONS):
            parameters = node.args.posonlyargs + node.args.args + node.args.kwonlyargs
            counts["> 8 parameters"] += (
                len({parameter.arg for parameter in parameters} - {"self", "cls"}) > 8
            )
            counts["complexity > 12"] += complexity(node) > 12


def measure(folder):
    """Return the value of each row for the Python files of a folder."""
    counts = Counter()
    for file in folder.rglob("*.py"):
        text = file.read_text(encoding="utf-8")
        count_tokens(text, counts)
        count_constructs(ast.parse(text), counts)
        counts["files"] += 1
    statements = max(counts["statements"], 1)
    counts["tokens/line"] = counts["tokens"] / max(counts["code lines"], 1)
    counts["tokens/statement"] = counts["tokens"] / statements
    values = {}
    for name in ROWS:
        values[name] = counts[name] if name in SIZES else 1000.0 * counts[name] / statements
    return values


def print_table(folders, columns):
    """Print a line for each row and a column for each folder."""
    names = "".join(f"{folder.name[:10]:>11}" for folder in folders)
    print(f"{'':32}{'target':>8}{names}")
    for name, largest in ROWS.items():
        target = "" if math.isinf(largest) else largest
        line = f"{name:32}{target:>8}"
        for column in columns:
            line += f"{column[name]:11.1f}"
        print(line)


def main(arguments):
    """Print a table; return 1 where a row of the last folder is above its target and --check is given."""
    totals = [Path(argument) for argument in arguments if argument != "--check"]
    folders = []
    if len(totals) == 1:
        parts = [part for part in sorted(totals[0].iterdir()) if part.is_dir()]
        folders = [part for part in parts if any(part.rglob("*.py"))]
    folders += totals
    columns = [measure(folder) for folder in folders]
    print_table(folders, columns)

    total = columns[-1]
    missed = [name for name, largest in ROWS.items() if total[name] > largest]
    print(f"{folders[-1].name} is above the target in: {', '.join(missed) or 'nothing'}")
    return int("--check" in arguments and bool(missed))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
