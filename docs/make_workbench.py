"""Pictures of the workbench for README and docs, and a film of ten seconds, taken in a real browser.

    python docs/make_workbench.py [--browser FILE]

Writes docs/images/workbench*.png and workbench.gif.
"""

from __future__ import annotations

import argparse
import io
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from PIL import Image

IMAGES = Path(__file__).parent / "images"
WIDE, FILMED = {"width": 1400, "height": 900}, {"width": 1000, "height": 680}
# Frames of the film, and time of each [ms].
FRAMES, EACH = 100, 100


@contextmanager
def shown(browser: Any, model: str, size: dict[str, int], scheme: str = "light") -> Iterator[Any]:
    """A page of `paraflex edit` with a model."""
    command = [sys.executable, "-m", "paraflex", "edit", model, "--no-open"]
    with (
        tempfile.TemporaryDirectory() as drafts,
        subprocess.Popen(
            command, stdout=subprocess.PIPE, text=True, env={**os.environ, "XDG_STATE_HOME": drafts}
        ) as process,
    ):
        assert process.stdout is not None
        page = browser.new_page(viewport=size, color_scheme=scheme)
        page.goto(re.search(r"http://\S+", process.stdout.readline())[0])  # type: ignore[index]
        page.wait_for_function("() => workbench.state.picture && workbench.sheet.frames > 2")
        page.wait_for_timeout(1200)
        try:
            yield page
        finally:
            page.close()


def place(page: Any, ref: str) -> tuple[float, float]:
    """Where a point is on the screen."""
    x, y = page.evaluate(
        "(ref) => { const [, x, y] = workbench.state.picture.points.find(([one]) => one === ref),"
        " box = workbench.sheet.canvas.getBoundingClientRect(), [px, py] = workbench.sheet.px(x, y);"
        " return [box.left + px, box.top + py]; }",
        ref,
    )
    return x, y


def picture(page: Any, name: str) -> None:
    """Write what a page shows."""
    page.screenshot(path=IMAGES / f"{name}.png")
    image = Image.open(IMAGES / f"{name}.png").convert("P", palette=Image.Palette.ADAPTIVE, colors=128)
    image.save(IMAGES / f"{name}.png", optimize=True)


def film(page: Any) -> list[Image.Image]:
    """The five-bar dragged in a circle, and then its run."""
    x, y = place(page, "distal1.C")
    frames = []

    def keep() -> None:
        found = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
        frames.append(found.convert("P", palette=Image.Palette.ADAPTIVE, colors=96))

    page.mouse.move(x, y)
    page.mouse.down()
    for k in range(FRAMES // 2):
        share = k / (FRAMES // 2 - 1)
        page.mouse.move(x - 70 * share, y - 60 * share)
        keep()
    page.mouse.up()
    page.evaluate("() => workbench.request('back')")
    page.get_by_role("button", name=re.compile("Run")).first.click()
    page.wait_for_timeout(6000)
    for _ in range(FRAMES - len(frames)):
        page.wait_for_timeout(EACH)
        keep()
    return frames


def main() -> None:
    """Write all pictures."""
    from playwright.sync_api import sync_playwright

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--browser", help="Chromium; by default Playwright's own")
    asked = parser.parse_args()
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=asked.browser, args=["--no-sandbox"])
        with shown(browser, "five_bar", WIDE) as page:
            picture(page, "workbench")
        with shown(browser, "five_bar", FILMED) as page:
            frames = film(page)
            frames[0].save(
                IMAGES / "workbench.gif", save_all=True, append_images=frames[1:], duration=EACH, loop=0, optimize=True
            )
        browser.close()


if __name__ == "__main__":
    main()
