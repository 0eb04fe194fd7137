"""The README's moving picture: a run's report in a browser, cycle by cycle from before it was lost until it was found.

``python -m docs.tools.rescue RUN OUT.webp``; it needs Chromium and the extra ``browser``.
"""

from __future__ import annotations

import io
import shutil
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image
from playwright.sync_api import sync_playwright

from harvey.report.page import build_page
from logs.run_directory import RunDirectory
from logs.timeline import Timeline

WIDTH, HEIGHT = 1000, 505
BEFORE, AFTER, FRAMES = 24, 10, 22
"""So many cycles before it is lost and after it is found, in about so many pictures."""
LASTS_MS, LAST_MS, QUALITY = 800, 3000, 45
STYLE = """
header pre, header p, nav, #replay > h2, form.scrubber, figcaption, #replay > :nth-child(n + 6) { display: none; }
body { max-width: none; padding: 0 0.8rem; } h1 { font-size: 1.3rem; margin: 0.6rem 0; }
#plans svg { max-height: 24rem; } #picture { max-height: 24rem; }
"""


def draw(run: Path, out: Path) -> None:
    """Draw the moving picture of a run in which the robot was lost and found."""
    files = RunDirectory(run)
    page_text = build_page(files, Timeline(files.journal))
    with TemporaryDirectory() as folder, sync_playwright() as driver:
        file = Path(folder) / "report.html"
        file.write_text(page_text, encoding="utf-8")
        browser = driver.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT}, color_scheme="light", bypass_csp=True)
        page.goto(file.as_uri())
        page.add_style_tag(content=STYLE)
        page.wait_for_function("run !== undefined")
        turns = page.evaluate("run.turns.map((turn) => [turn.kind, turn.cycle, turn.text])")
        lost = next(cycle for kind, cycle, _ in turns if kind == "lost")
        found = next(cycle for kind, cycle, _ in turns if kind == "found" and cycle >= lost)
        cycles = range(lost - BEFORE, found + AFTER + 1)
        step = max(1, len(cycles) // FRAMES)
        pictures = []
        for cycle in (*cycles[::step], found, found + AFTER):
            page.evaluate(f"show({cycle})")
            page.wait_for_timeout(150)
            state = "lost" if lost <= cycle < found else "found again" if cycle >= found else "driving"
            page.evaluate("(text) => { document.querySelector('h1').textContent = text; }", f"cycle {cycle}: {state}")
            shot = page.screenshot()
            pictures.append((cycle, Image.open(io.BytesIO(shot)).convert("RGB")))
        browser.close()
    pictures.sort(key=lambda one: one[0])
    images = [picture for _, picture in pictures]
    images[0].save(out, save_all=True, append_images=images[1:], duration=[LASTS_MS] * (len(images) - 1) + [LAST_MS],
                   loop=0, quality=QUALITY)


if __name__ == "__main__":
    draw(Path(sys.argv[1]), Path(sys.argv[2]))
