"""How fast is the workbench in a real browser? Drags, changed lengths, and flexible runs after a release.

    python benchmarks/workbench.py [--browser FILE] [--repeats N] [--write]

`paraflex edit` serves the page, Chromium without a window shows it at 1400 x 1000. Measured for the five-bar and for
RAParM-I, warm: updates with closed loops and frames drawn in each second while the mouse drags the end-effector in
circles; time from a changed length to its held frequencies and compliance ellipse, in the browser; and time from a
release to the flexible motion in all modes of the study. The table has the goals.
"""

from __future__ import annotations

import os
import re
import statistics
import subprocess
import sys
import tempfile
from typing import Any

from common import command_line, conditions, table, write_json

GOALS = {"updates": 30.0, "frames": 60.0, "length": 0.050, "run five_bar": 0.5, "run raparm_i": 1.0}
# A place in the middle of a link's length, and how the mouse drags the end-effector: steps, radius [px], seconds.
LENGTHS = {"five_bar": (["parameters", "l1"], 0.25), "raparm_i": (["body", "link1", "length"], 0.25)}
STEPS, RADIUS = 240, 40.0
WARM = 20_000  # [ms]
# Replies are counted in the page, where they arrive.
COUNT = """() => {
    const { link, sheet } = workbench, ask = link.ask.bind(link);
    window.counted = { updates: 0, frames: sheet.frames, began: performance.now() };
    link.ask = (what, fields) => {
        const reply = ask(what, fields);
        if (what === "drag") reply.then(() => counted.updates++);
        return reply;
    };
    window.stopCounting = () => {
        const seconds = (performance.now() - counted.began) / 1000;
        link.ask = ask;
        return [counted.updates / seconds, (sheet.frames - counted.frames) / seconds];
    };
}"""
CHANGE = """async ([place, text]) => {
    const began = performance.now();
    const state = await workbench.request("act", { action: { kind: "set", place, text } });
    if (!state?.seen || (state.seen.held ?? []).length === 0) throw new Error("no held frequencies");
    return (performance.now() - began) / 1000;
}"""
RUN = """async () => {
    const began = performance.now();
    const seconds = () => (performance.now() - began) / 1000;
    const done = new Promise((resolve, reject) => workbench.link.on("run", (event) => {
        if (event.state === "done" || event.state === "preview") resolve([event.state, seconds()]);
        if (event.state === "error") reject(new Error(event.text));
    }));
    await workbench.link.ask("run", {});
    return done;
}"""


def measured(page: Any, model: str, repeats: int) -> dict[str, Any]:
    """What a page that shows a model takes."""
    x, y = page.evaluate(
        "() => { const { picture } = workbench.state, box = workbench.sheet.canvas.getBoundingClientRect();"
        " const [, x, y] = picture.points.find(([ref]) => ref === picture.effector);"
        " const [px, py] = workbench.sheet.px(x, y); return [box.left + px, box.top + py]; }"
    )
    rates = []
    for _ in range(repeats):
        page.mouse.move(x, y)
        page.mouse.down()
        page.evaluate(COUNT)
        page.evaluate(
            """async ([x, y, steps, radius]) => {
                const canvas = workbench.sheet.canvas;
                for (let k = 0; k <= steps; k++) {
                    const angle = 4 * Math.PI * k / steps;
                    const at = { clientX: x + radius * Math.sin(angle), clientY: y + radius * (1 - Math.cos(angle)) };
                    const moved = { ...at, buttons: 1, pointerId: 1, bubbles: true };
                    canvas.dispatchEvent(new PointerEvent("pointermove", moved));
                    await new Promise((resolve) => setTimeout(resolve, 8));
                }
            }""",
            [x, y, STEPS, RADIUS],
        )
        rates.append(page.evaluate("() => stopCounting()"))
        page.mouse.up()
        page.wait_for_timeout(300)
        page.evaluate("() => workbench.request('back')")
    place, length = LENGTHS[model]
    times = [page.evaluate(CHANGE, [place, f"{length * (1.0 + 0.002 * k):.6g}"]) for k in range(1, repeats + 3)][2:]
    runs = []
    for _ in range(repeats + 1):
        runs.append(page.evaluate(RUN))
        page.wait_for_timeout(500)
    return {
        "updates": statistics.median(rate[0] for rate in rates),
        "frames": statistics.median(rate[1] for rate in rates),
        "length": statistics.median(times),
        "run": statistics.median(seconds for _, seconds in runs[1:]),
        "run_state": runs[-1][0],
    }


def main() -> None:
    """Print the table."""
    from playwright.sync_api import sync_playwright

    parser = command_line(__doc__)
    parser.add_argument("--browser", help="Chromium; by default Playwright's own")
    parser.add_argument("--repeats", type=int, default=5)
    asked = parser.parse_args()
    found = {}
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=asked.browser, args=["--no-sandbox"])
        for model in LENGTHS:
            command = [sys.executable, "-m", "paraflex", "edit", model, "--no-open"]
            with (
                tempfile.TemporaryDirectory() as drafts,
                subprocess.Popen(
                    command, stdout=subprocess.PIPE, text=True, env={**os.environ, "XDG_STATE_HOME": drafts}
                ) as process,
            ):
                assert process.stdout is not None
                page = browser.new_page(viewport={"width": 1400, "height": 1000})
                page.goto(re.search(r"http://\S+", process.stdout.readline())[0])  # type: ignore[index]
                page.wait_for_function("() => workbench.state.picture && workbench.sheet.frames > 2")
                # Until both processes of runs are warm, they take the processors from what is measured.
                page.wait_for_timeout(WARM)
                found[model] = measured(page, model, asked.repeats)
                page.close()
        browser.close()
    rows = [
        [
            model, f"{one['updates']:.0f}", f"{one['frames']:.0f}", f"{1e3 * one['length']:.0f}",
            f"{one['run']:.2f} ({one['run_state']})", f"{GOALS[f'run {model}']:g}",
        ]
        for model, one in found.items()
    ]  # fmt: skip
    headings = ["model", "updates/s (30)", "frames/s (60)", "new length [ms] (50)", "release to motion [s]", "goal [s]"]
    print(table(headings, rows))
    print(write_json("workbench", {**conditions(), "models": found}, asked.folder))


if __name__ == "__main__":
    main()
