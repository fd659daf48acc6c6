"""Make the pictures of the README from the demo: the scene in a loop, three rows of ellipsoids, and the page.

    python scripts/make_readme_pictures.py [--check]

Runs the demo, opens its page in a headless Chromium and writes ``docs/demo.webp``, ``docs/demo_ellipsoids.png``,
``docs/report.png`` and ``docs/demo.json``, the figures that the README tells. With ``--check`` nothing is written: the
demo's figures are compared with those of ``docs/demo.json``, so that pictures and figures cannot grow old unnoticed.
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
from maniport.report import figures
from maniport.report.roles import ACHIEVED, PERSON, TARGET
from maniport.report.write import write_results

HOME = Path(__file__).parents[1]
DOCS = HOME / "docs"
FRAMES, WIDTH, SIZE, TALL = 80, 700, (1024, 768), (900, 1200)
"""Of the loop, its width, and the windows for the page and for the scene [pixels]."""
SCENE = ".stages"
TOLERANCE = 0.25
"""Relative change from which pictures are out of date. Processors round differently, which a plan feels, above all in
what is largest: that is not compared."""


def figures_of(result: mp.TransferResult) -> dict[str, float]:
    """What the README tells of the demo."""
    motion = result.arm.motion
    told = {
        "distance_median": np.median(motion.distance),
        "distance_95": np.percentile(motion.distance, 95),
        "distance_largest": motion.distance.max(),
        "tip_median_mm": 1e3 * np.median(motion.position_error),
        "tip_95_mm": 1e3 * np.percentile(motion.position_error, 95),
        "tip_largest_mm": 1e3 * motion.position_error.max(),
        "duration_s": motion.control_time[-1],
        "person_s": np.ptp(result.time),
    }
    return {name: float(f"{value:.3g}") for name, value in told.items()}


def check(now: dict[str, float]) -> None:
    """End with exit code 1 where a figure is not what the pictures were made from."""
    before = json.loads((DOCS / "demo.json").read_text(encoding="utf-8"))
    old = [
        name for name in {*now, *before} if not np.isclose(now.get(name, np.nan), before.get(name, np.nan), TOLERANCE)
    ]
    if old:
        changes = "; ".join(f"{name} {before.get(name)} → {now.get(name)}" for name in sorted(old))
        sys.exit(f"the README's pictures are out of date: run python scripts/make_readme_pictures.py ({changes})")
    print("the README's pictures are of this version")


def three_rows(result: mp.TransferResult) -> None:
    """Draw the ellipsoids of the person, those that are asked for and those that the robot makes."""
    arm = result.arm
    rows = {"person": arm.demonstrated_profile, "target": arm.target_profile, "achieved": in_place(result)}
    roles = {"person": PERSON.name, "target": TARGET.name, "achieved": ACHIEVED.name}
    figure = figures.ellipsoids(result.time, rows, roles=roles)
    figures.save(figure, DOCS / "demo_ellipsoids.png")


def in_place(result: mp.TransferResult) -> np.ndarray:
    """What the robot makes, in the frame of the targets before the path was placed."""
    turn = result.arm.placement.rotation
    return turn.T @ result.arm.motion.achieved @ turn


def loop(browser: "Browser") -> None:  # noqa: F821 - tests/headless_chromium
    """Take pictures of the scene over the whole motion."""
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
        DOCS / "demo.webp", save_all=True, append_images=small[1:], duration=1000 * 8 // FRAMES, loop=0, quality=60
    )


def shot(browser: "Browser") -> Image.Image:  # noqa: F821 - tests/headless_chromium
    """What is seen."""
    with tempfile.NamedTemporaryFile(suffix=".png") as file:
        browser.picture(file.name)
        return Image.open(io.BytesIO(Path(file.name).read_bytes())).convert("RGB")


def main() -> None:
    """Run the demo and make or check."""
    words = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    words.add_argument("--check", action="store_true", help="only compare the demo's figures with the pictures'")
    options = words.parse_args()
    result = mp.transfer_recording("freeform")
    if options.check:
        check(figures_of(result))
        return
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
    three_rows(result)
    (DOCS / "demo.json").write_text(json.dumps(figures_of(result), indent=2) + "\n", encoding="utf-8")
    for name in ("demo.webp", "demo_ellipsoids.png", "report.png"):
        print(f"{name}: {(DOCS / name).stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
