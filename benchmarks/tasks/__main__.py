"""Run the task study, or score a joint file on one of its tasks: ``python -m benchmarks.tasks``."""

import argparse
import sys
from pathlib import Path

from maniport.errors import ManiportError
from maniport.report.console import Console

from .run import score_file, study_tasks


def arguments() -> argparse.ArgumentParser:
    """Return the parser of both commands."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.tasks", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)

    study = commands.add_parser("run", help="run the study; an interrupted one is resumed")
    study.add_argument("-o", "--output", type=Path, default=Path("maniport-tasks"))
    study.add_argument("--seed", type=int, default=0)
    study.add_argument("--quick", action="store_true", help="four recordings on the Panda only")
    study.add_argument("--robots", nargs="+", default=(), metavar="ROBOT")
    study.add_argument("--recordings", type=Path, help="folder of further BVH files")

    scoring = commands.add_parser("score", help="score joint positions on the task of a file")
    scoring.add_argument("motion", type=Path, metavar="JOINTS.csv")
    scoring.add_argument("task", type=Path, metavar="TASK.json")
    return parser


def main(words: list[str] | None = None) -> int:
    """Run a command and print its report; return 1 after an error."""
    options = arguments().parse_args(words)
    console = Console()
    try:
        if options.command == "score":
            console.print_report(score_file(options.motion, options.task))
            return 0

        with console.progress() as progress:
            report = study_tasks(
                options.output,
                options.seed,
                progress,
                quick=options.quick,
                robots=options.robots,
                recordings=options.recordings,
            )
        console.print_report(report, output=str(options.output))
    except ManiportError as error:
        print(f"Error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
