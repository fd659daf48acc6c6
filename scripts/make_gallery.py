"""Run the examples and make the gallery of the docs: one small picture of each, and a page.

    python scripts/make_gallery.py [FOLDER]

Writes ``gallery.md`` and ``gallery/*.png`` into the folder, by default ``docs``. What an example says it teaches is the
first paragraph of its docstring, so that the page cannot say anything else.
"""

import ast
import contextlib
import io
import runpy
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

import maniport as mp
from maniport.telling import figures
from maniport.telling.roles import ACHIEVED

HOME = Path(__file__).parents[1]
WIDTH = 700
"""Of the pictures, in pixels."""
COLOURS = 256
"""So many keep pale blue apart from pale green, and a picture below 100 kB."""


def panda(joints: np.ndarray) -> Figure:
    """The Panda in a few postures of a motion."""
    arm = mp.load_arm("panda")
    profile = arm.manipulability(joints)
    return figures.arms({"panda": arm.skeleton(joints)}, {"panda": profile}, roles={"panda": ACHIEVED.name})


def joints_of(path: Path) -> np.ndarray:
    """Joint positions from what an example wrote."""
    if path.suffix == ".csv":
        return np.loadtxt(path, delimiter=",", skiprows=1)[:, 1:8]
    with np.load(path) as arrays:
        return arrays["joint_positions"]


def followed(path: Path) -> Figure:
    """How well a motion follows its profile, and its joints."""
    arm = mp.load_arm("panda")
    with np.load(path) as found:
        joints = dict(zip(arm.joint_names, found["joint_positions"].T, strict=True))
        limits = dict(zip(arm.joint_names, zip(arm.lower, arm.upper, strict=True), strict=True))
        return figures.motion(found["time"], found["distance"], joints, limits, found["position_error"])


PICTURES: dict[str, tuple[str, Callable[[Path], Path | Figure]]] = {
    "01": ("The arm stretches; later postures are darker.", lambda folder: folder / "arm.png"),
    "02": ("Half-way, the straight line is fat; the geodesic stays slender.", lambda folder: folder / "ways.png"),
    "03": ("A person on a ladder, with the ellipsoid of the hand.", lambda folder: folder / "ladder_arm.png"),
    "04": ("Adapted ellipsoids lie on those that are true (dashed).", lambda folder: folder / "adapted.png"),
    "05": ("The motion that Pink's loop makes.", lambda folder: panda(joints_of(folder / "joints.npz"))),
    "06": ("The person's way, on the robot.", lambda folder: panda(joints_of(folder / "joints.csv"))),
    "07": (
        "The motion that the demonstrations' covariance weighs.",
        lambda folder: panda(joints_of(folder / "joints.csv")),
    ),
    "08": ("The motion that is replayed, before physics.", lambda folder: followed(folder / "joints.npz")),
}
"""By number: what a picture shows, and how it is had from the folder of the example."""


def small(picture: Path | Figure, target: Path) -> None:
    """Write a picture in few colours and a width for the screen."""
    stream = io.BytesIO()
    if isinstance(picture, Figure):
        picture.savefig(stream, format="png", dpi=300)
        picture = stream
    with Image.open(picture) as image:
        height = round(image.height * WIDTH / image.width)
        shown = image.convert("RGB").resize((WIDTH, height), Image.Resampling.LANCZOS)
    shown.quantize(COLOURS, dither=Image.Dither.NONE).save(target, optimize=True)


def main(docs: Path) -> None:
    """Make pictures and page."""
    (docs / "gallery").mkdir(parents=True, exist_ok=True)
    page = ["# Gallery", "", "The examples of `examples/`, one idea each; every picture is what the example makes.", ""]
    for example in sorted((HOME / "examples").glob("[0-9]*.py")):
        caption, picture = PICTURES[example.stem[:2]]
        title, text = ast.get_docstring(ast.parse(example.read_text(encoding="utf-8"))).split("\n\n")[:2]
        with tempfile.TemporaryDirectory() as name, contextlib.redirect_stdout(io.StringIO()):
            runpy.run_path(str(example))["main"](Path(name))
            small(picture(Path(name)), docs / "gallery" / f"{example.stem}.png")
        page += [f"## {example.stem[:2]} {' '.join(title.split()).rstrip('.')}", "", " ".join(text.split()), ""]
        page += [f"![{caption}](gallery/{example.stem}.png)", "", f"{caption} "]
        page[-1] += f"[{example.name}](../examples/{example.name})"
        page += [""]
        print(f"{example.stem}: {(docs / 'gallery' / f'{example.stem}.png').stat().st_size / 1e3:.0f} kB")
    (docs / "gallery.md").write_text("\n".join(page), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else HOME / "docs")
