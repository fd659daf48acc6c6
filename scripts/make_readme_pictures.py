"""Make the pictures of the README from the demo: an animation, three rows of ellipsoids, and the page.

    python scripts/make_readme_pictures.py [--check FOLDER]

Runs the demo, opens its page in a headless Chromium and writes ``docs/demo.webp``, ``docs/demo_ellipsoids.png``,
``docs/report.png`` and ``docs/demo.json``, the figures in the README. With ``--check`` nothing is written: the figures
of a result of ``maniport demo`` are compared with ``docs/demo.json``, so that outdated pictures are noticed.
"""

import argparse
import io
import json
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from PIL import Image

import maniport as mp
from maniport.report import figures as plots
from maniport.report.page.content import ACHIEVED, PERSON, TARGET
from maniport.report.write import write_results

HOME = Path(__file__).parents[1]
DOCS = HOME / "docs"
FRAMES = 80
WIDTH = 700
SIZE = (1024, 768)
TALL = (900, 1200)
"""Frames of the animation, its width, and the window sizes for page and scene [pixels]."""
SCENE = ".stages"
STATISTICS = {"median": "median", "95": "p95", "largest": "max"}
TOLERANCE = 0.25
"""Relative change from which pictures are out of date. Rounding differs between processors and changes plans slightly,
most of all their maxima, which are not compared."""


def figures_of(folder: Path) -> dict[str, float]:
    """Return the figures of the demo in the README, to three digits."""
    motion = json.loads((folder / "summary.json").read_text(encoding="utf-8"))["motion"]
    error = motion["position_error_mm"]
    duration = motion["duration_s"]
    figures = {f"distance_{name}": motion["distance"][key] for name, key in STATISTICS.items()}
    figures |= {f"position_error_{name}_mm": error[key] for name, key in STATISTICS.items()}
    figures |= {"duration_s": duration["robot"], "person_s": duration["person"]}
    for key, name in (("force", "force_N"), ("velocity", "speed_m/s")):
        figures[name] = motion[key]["robot"]["median"]
        figures[f"{name}_5"] = motion[key]["robot"]["p5"]
        figures[f"{name}_positions_only"] = motion[key]["position_only"]["median"]
    return {name: float(f"{value:.3g}") for name, value in figures.items()}


def check(now: dict[str, float]) -> None:
    """Exit with code 1 if a figure differs from that of the pictures."""
    before = json.loads((DOCS / "demo.json").read_text(encoding="utf-8"))
    old = [
        name
        for name in {*now, *before}
        if not np.isclose(now.get(name, np.nan), before.get(name, np.nan), TOLERANCE)
    ]
    if old:
        changes = "; ".join(f"{name} {before.get(name)} → {now.get(name)}" for name in sorted(old))
        sys.exit(
            f"the README's pictures are out of date: run python scripts/make_readme_pictures.py ({changes})"
        )
    print("the README's pictures are of this version")


def three_rows(result: mp.TransferResult) -> None:
    """Draw demonstrated, target and achieved ellipsoids."""
    arm = result.arm
    rows = {
        "person": arm.demonstrated_profile,
        "target": arm.target_profile,
        "achieved": in_place(result),
    }
    roles = {"person": PERSON.name, "target": TARGET.name, "achieved": ACHIEVED.name}
    figure = plots.ellipsoids(result.time, rows, roles=roles)
    plots.save(figure, DOCS / "demo_ellipsoids.png")


def in_place(result: mp.TransferResult) -> np.ndarray:
    """Return achieved ellipsoids in the frame of the targets before placement."""
    turn = result.arm.placement.rotation
    return turn.T @ result.arm.motion.achieved @ turn


def loop(browser: "Browser") -> None:  # noqa: F821 - tests/headless_chromium
    """Write the animation of the scene."""
    last = float(browser.run("document.querySelector('input[type=range]').max"))
    shots = []
    for i in range(FRAMES):
        browser.run(f"location.hash = 't={last * i / FRAMES:.3f}'")
        time.sleep(0.15)
        box = browser.run(
            f"(r => [r.x, r.y, r.right, r.bottom])(document.querySelector('{SCENE}').getBoundingClientRect())"
        )
        shots.append(shot(browser).crop(tuple(box)))
    height = round(shots[0].height * WIDTH / shots[0].width)
    small = [one.resize((WIDTH, height), Image.Resampling.LANCZOS) for one in shots]
    small[0].save(
        DOCS / "demo.webp",
        save_all=True,
        append_images=small[1:],
        duration=1000 * 8 // FRAMES,
        loop=0,
        quality=60,
    )


def shot(browser: "Browser") -> Image.Image:  # noqa: F821 - tests/headless_chromium
    """Return a screenshot."""
    with tempfile.NamedTemporaryFile(suffix=".png") as file:
        browser.picture(file.name)
        return Image.open(io.BytesIO(Path(file.name).read_bytes())).convert("RGB")


def main() -> None:
    """Run the demo and make or check."""
    words = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    words.add_argument(
        "--check", type=Path, metavar="FOLDER", help="result folder of the demo to compare"
    )
    options = words.parse_args()
    if options.check:
        check(figures_of(options.check))
        return
    result = mp.transfer_recording("freeform")
    sys.path.insert(0, str(HOME / "tests"))
    from headless_chromium import Browser

    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryDirectory() as profile:
        write_results(result, Path(folder) / "demo")
        browser = Browser(Path(profile))
        try:
            browser.dress(*SIZE)
            browser.open(Path(folder) / "demo" / "report.html")
            time.sleep(2.0)
            image = shot(browser)
            image.quantize(256, dither=Image.Dither.NONE).save(DOCS / "report.png", optimize=True)
            browser.dress(*TALL)
            loop(browser)
        finally:
            browser.close()
        figures = figures_of(Path(folder) / "demo")
    three_rows(result)
    (DOCS / "demo.json").write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")
    for name in ("demo.webp", "demo_ellipsoids.png", "report.png"):
        print(f"{name}: {(DOCS / name).stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
