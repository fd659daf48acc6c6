"""The site that `make docs` made, in a browser without a network: nothing is wider than a phone, and search finds.

Skipped where the site was not made, and failing instead where the environment variable MANIPORT_NEEDS_SITE is set.
"""

import functools
import os
import threading
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

from headless_chromium import browser  # noqa: F401  a fixture

SITE = Path(__file__).parents[1] / "build" / "docs"
PHONE = 390
WIDTHS = """(async (pages, width) => {
    const wide = {};
    const look = page => new Promise(done => {
        const frame = document.createElement("iframe");
        frame.style = `width: ${width}px; height: 844px; border: 0`;
        frame.onload = () => {
            const found = frame.contentDocument.scrollingElement.scrollWidth;
            if (found > width || !frame.contentDocument.title) wide[page] = found;
            frame.remove();
            done();
        };
        frame.src = page;
        document.body.append(frame);
    });
    const waiting = [...pages];
    const worker = async () => { while (waiting.length) await look(waiting.pop()); };
    await Promise.all([worker(), worker(), worker(), worker()]);
    return wide;
})"""


class Quiet(SimpleHTTPRequestHandler):
    """Says nothing of what it is asked for."""

    def log_message(self, *_):
        """Nothing."""


@pytest.fixture(scope="module")
def site():
    """The folder of the site."""
    if not (SITE / "index.html").exists():
        (pytest.fail if os.environ.get("MANIPORT_NEEDS_SITE") else pytest.skip)("no build/docs; make docs")
    return SITE


@pytest.fixture(scope="module")
def address(site):
    """The site behind an address, as a web server has it."""
    with ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=site)) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


@pytest.fixture
def phone(browser):  # noqa: F811
    """The browser at the size of a phone."""
    browser.dress(PHONE, 844, touch=True)
    yield browser
    browser.dress()


def test_no_page_is_wider_than_a_phone(phone, site, address):
    """Tables, formulas and code scroll in themselves: no page has to be moved sideways."""
    pages = [f"/{page.relative_to(site)}" for page in site.rglob("*.html") if page.name != "report.html"]
    phone.go(f"{address}/search.html")
    phone.wait("document.body && document.readyState === 'complete'")
    assert phone.run(f"{WIDTHS}({pages}, {PHONE})") == {}


def test_search_finds_without_a_network(browser, site):  # noqa: F811
    """Opened as a file, the site finds pages of a word, and asks nobody else for anything."""
    browser.go(f"{(site / 'search.html').as_uri()}?q=ellipsoid")
    browser.wait("document.querySelectorAll('#search-results li a').length > 5")
    assert [one for one in browser.requests if not one.startswith(("file:", "data:", "about:"))] == []
