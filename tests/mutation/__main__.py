"""Changes `spd` and `transfer` in one place at a time and says where no test notices: ``make mutants``.

mutmut makes the mutants, in a copy of the tree in a temporary folder; `trial` runs the tests that reach each.
"""

import argparse
import contextlib
import difflib
import json
import math
import os
import random
import shutil
import subprocess
import sys
import time
from collections import Counter
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

ROOT = Path(__file__).parents[2]
ROOMS = {
    "spd": [
        "tests/spd",
        "tests/laws/test_spd_laws.py",
        "tests/transfer/test_damping.py",
        "tests/report/test_directions.py",
    ],
    "transfer": ["tests/transfer", "tests/laws/test_transfer_laws.py"],
}
"""Where mutants are made, and which tests are to notice."""
NEW_PROCESSES = "uncompiled or vector_type or heavy_libraries or tells_the_spread"
"""Tests that start Python anew: that takes long, and workers of joblib do not survive a fork."""
COMPILED = ("loops.py", "single.py", "length_field/kernels.py")
"""What Numba compiles: mutants would be compiled one by one."""


def modules(room: str, pattern: str | None) -> list[str]:
    """Return the files of a room that mutants are made of, or those asked for, from `maniport` on."""
    package = ROOT / "src/maniport"
    names = [path.relative_to(package) for path in sorted((package / room).rglob("*.py"))]
    return [
        name.as_posix()
        for name in names
        if not name.as_posix().endswith(COMPILED) and (pattern is None or name.match(pattern))
    ]


def mutate(tree: Path, names: list[str]) -> dict[str, str]:
    """Write modules with all their mutants into a tree; return the diff of each mutant by its name."""
    from mutmut.mutation import file_mutation, mutators

    def first_string(node: Any) -> list[Any]:  # a word in capitals shows nothing that another word does not
        return list(mutators.operator_string(node))[:1]

    file_mutation.mutation_operators = [
        (kind, first_string if operator is mutators.operator_string else operator)
        for kind, operator in file_mutation.mutation_operators
    ]
    diffs = {}
    for name in names:
        path = tree / "src/maniport" / name
        mutated = file_mutation.mutate_file_contents(str(path), path.read_text())
        lines, spans = mutated.code.splitlines(), mutated.line_span_by_function_name
        path.write_text(mutated.code)
        module = f"maniport.{name.removesuffix('.py').removesuffix('/__init__').replace('/', '.')}"
        for mutant in mutated.mutant_names:
            original = mutant.rpartition("__mutmut_")[0] + "__mutmut_orig"
            before, after = (
                [line.replace(one, mutant) for line in lines[spans[one].start - 1 : spans[one].end]]
                for one in (original, mutant)
            )
            changed = difflib.unified_diff(before, after, n=0, lineterm="")
            kept = [line for line in changed if not line.startswith(("---", "+++", "@@"))]
            diffs[f"{module}.{mutant}"] = "\n".join(kept)
    return diffs


def run(room: str, names: list[str], limits: argparse.Namespace, kept: Path) -> None:
    """Make mutants, try a share of those of each module, print what became of them and keep those not killed."""
    with contextlib.ExitStack() as stack:
        tree = Path(stack.enter_context(TemporaryDirectory(prefix="mutants-")))
        # with the times of the files, and what Numba has compiled
        shutil.copytree(ROOT / "src", tree / "src", copy_function=shutil.copy2)
        shutil.copytree(ROOT / "tests", tree / "tests")
        shutil.copy2(ROOT / "pyproject.toml", tree)
        stack.enter_context(contextlib.chdir(tree))
        diffs = mutate(tree, names)
        by_module: dict[str, list[str]] = {}
        for mutant in diffs:
            by_module.setdefault(mutant.rpartition(".")[0], []).append(mutant)
        ranked = []
        for module, mutants in by_module.items():
            random.Random(module).shuffle(mutants)
            ranked += [(rank / len(mutants), mutant) for rank, mutant in enumerate(mutants)]
        # of all modules in turn
        asked = [mutant for rank, mutant in sorted(ranked) if rank < limits.share]
        Path("asked.json").write_text(json.dumps(asked))
        command = [sys.executable, "-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider", "-p", "mutation.trial"]
        command += ["--hypothesis-profile=mutants", "--mutants=asked.json", "--outcomes=outcomes.json"]
        command += [f"--{name}={getattr(limits, name)}" for name in ("minutes", "jobs")]
        command += ["-k", f"not ({NEW_PROCESSES})", *ROOMS[room]]
        paths = f"{tree / 'src'}{os.pathsep}{tree / 'tests'}"
        process = subprocess.run(command, env=os.environ | {"PYTHONPATH": paths, "OMP_NUM_THREADS": "1"}, check=False)
        if process.returncode:
            sys.exit(f"the tests of {room} do not pass without mutants, or could not be run")
        outcomes: dict[str, str] = json.loads(Path("outcomes.json").read_text())
    for module, mutants in by_module.items():
        counts = Counter(outcomes[mutant] for mutant in mutants if mutant in outcomes)
        print(f"{module:48} {len(mutants):6} mutants: {dict(counts)}")
    print(f"{room:48} {len(diffs):6} mutants: {dict(Counter(outcomes.values()))}")
    with kept.open("a") as file:
        for mutant, outcome in sorted(outcomes.items()):
            if outcome != "killed":
                file.write(f"{outcome}: {mutant}\n{diffs[mutant]}\n")


def main() -> int:
    """Try both rooms, or one module."""
    parser = argparse.ArgumentParser(prog="python -m mutation", description="Says which mutants no test notices.")
    parser.add_argument(
        "module", nargs="?", help="one alone, such as spd/mean.py, or a pattern; default: all of both rooms"
    )
    parser.add_argument("--room", choices=list(ROOMS), help="one room alone")
    parser.add_argument("--share", type=float, default=1.0, help="of the mutants of each module, the same in each run")
    parser.add_argument("--minutes", type=float, default=math.inf, help="for each room; later mutants are not tried")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="how many mutants at a time")
    arguments = parser.parse_args()
    rooms = {room: modules(room, arguments.module) for room in ROOMS if arguments.room in (None, room)}
    if not any(rooms.values()):
        parser.error(f"found {arguments.module!r}; allowed is a module of {' or '.join(ROOMS)}, such as spd/mean.py")
    print(f"mutmut {version('mutmut')}", flush=True)
    kept = Path("mutants.txt").resolve()
    kept.unlink(missing_ok=True)
    for room, names in rooms.items():
        if names:
            began = time.monotonic()
            run(room, names, arguments, kept)
            print(f"{time.monotonic() - began:.0f} s; what was not killed is in {kept}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
