"""Fixture: pages of the system's Chromium."""

import shutil
from collections.abc import Callable, Iterator

import pytest
from playwright.sync_api import Page


@pytest.fixture
def new_page() -> Iterator[Callable[..., Page]]:
    """Return what opens a page of the system's Chromium, of a width and a height; a page waits two minutes."""
    program = shutil.which("chromium")
    if program is None:
        pytest.skip("chromium is not installed")
    from playwright.sync_api import sync_playwright

    arguments = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking"]
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=arguments)

        def open_page(width: int = 1400, height: int = 900) -> Page:
            page = browser.new_page(viewport={"width": width, "height": height})
            page.set_default_timeout(120_000)
            return page

        yield open_page
        browser.close()
