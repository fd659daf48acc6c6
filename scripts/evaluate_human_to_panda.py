"""Measure what a transfer from a human arm to the Panda is worth, and write docs/evaluation.md.

    python scripts/evaluate_human_to_panda.py --jobs 2

Takes about five minutes. `--methods` takes any names that the command line knows, `--motions` a choice of the six. What
the page says of robots, which `scripts/lengths_on_robot.py` measures, stays as it is.
"""

import argparse
import json
import re
from pathlib import Path

import maniport as mp
from maniport.defaults import AUTO
from maniport.studies.human_to_panda import study, study_page
from maniport.telling.metrics import facts_of
from maniport.telling.renderings import as_numbers
from maniport.transfer import METHODS

ON_ROBOTS = "## What robots make of it"
PAGE = Path(__file__).parent.parent / "docs" / "evaluation.md"


def on_robots() -> str:
    """Return the section of the page that tells what robots make of it, empty where there is none."""
    text = PAGE.read_text(encoding="utf-8") if PAGE.is_file() else ""
    found = re.search(rf"^{ON_ROBOTS}\n.*?(?=^## |\Z)", text, flags=re.DOTALL | re.MULTILINE)
    return found.group() if found else ""


def main() -> None:
    """Run the study and write the page; with --json also all numbers."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--methods", nargs="+", default=[AUTO], choices=[AUTO, *METHODS])
    parser.add_argument("--motions", nargs="+", default=None)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=None)
    parser.add_argument("-o", "--output", type=Path, default=PAGE)
    parser.add_argument("--json", type=Path, default=None)
    given = parser.parse_args()
    with mp.progress() as tell:
        results = study(given.methods, given.motions, given.seed, given.jobs, progress=tell)
    given.output.write_text(study_page(results, on_robots()), encoding="utf-8")
    if given.json is not None:
        table = {f"{motion}, {method}": as_numbers(facts_of(one)) for (motion, method), (_, one) in results.items()}
        given.json.write_text(json.dumps(table, indent=1, allow_nan=False), encoding="utf-8")
    print(f"wrote {given.output}")


if __name__ == "__main__":
    main()
