"""Take the README's screenshots from a finished pipeline: ``python docs/screenshots.py [PROJECT]``.

It needs the system's Chromium, and a project in which ``make reproduce`` has run. Look at each picture before you
commit it.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from playwright.sync_api import sync_playwright

if TYPE_CHECKING:
    from playwright.sync_api import Page

IMAGES = Path(__file__).parent / "images"
SIZE = {"width": 1400, "height": 800}
WITHOUT_ASSISTANT = {"x": 0, "y": 0, "width": 1334, "height": 470}
"""MLflow's assistant takes the right of its pages."""


def main() -> None:
    """Write ``report.png`` and ``runs.png``."""
    project = Path(sys.argv[1] if len(sys.argv) > 1 else ".").absolute()
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        page = browser.new_page(viewport=SIZE)
        page.goto((project / "reports/report.html").as_uri())
        page.screenshot(path=IMAGES / "report.png")
        run_table(page, project)
        browser.close()


def run_table(page: Page, project: Path) -> None:
    """Open the MLflow UI of a project as ``make ui`` does, and take its run table."""
    command = [Path(sys.executable).with_name("cylinder-friction"), "ui"]
    with subprocess.Popen(command, cwd=project, stdout=subprocess.PIPE, text=True) as server:  # noqa: S603 - our own
        assert server.stdout is not None
        try:
            address = next(found[0] for line in server.stdout if (found := re.search(r"http://\S+", line)))
            page.set_viewport_size({"width": 1800, "height": 700})
            page.goto(address, timeout=120_000)
            page.get_by_text("default").first.wait_for(timeout=120_000)
            page.wait_for_timeout(3000)
            page.screenshot(path=IMAGES / "runs.png", clip=WITHOUT_ASSISTANT)
        finally:
            server.terminate()


if __name__ == "__main__":
    main()
