"""A real Chromium without a window, that tells what it fetched and what its console said."""

from __future__ import annotations

import json
import os
import shutil
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from selenium import webdriver
from selenium.webdriver.chrome.service import Service

from metaid.store import Store

FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)


# Of each figure that is shown: its height, texts that are beyond its edges by more than what letters differ by from one
# machine to another, and pairs of texts that are in one another's place.
FIGURES_SHOWN = """
const is = element => { const r = element.getBoundingClientRect(); return r.width > 0 && r.height > 0; };
return [...document.querySelectorAll('figure svg')].filter(is).map(svg => {
  const r = svg.getBoundingClientRect(), wrong = [];
  const texts = [...svg.querySelectorAll('text')].filter(is).map(t => [t.textContent, t.getBoundingClientRect()]);
  for (const [text, b] of texts)
    if (Math.max(r.left - b.left, b.right - r.right, r.top - b.top, b.bottom - r.bottom) > 0.03 * r.width)
      wrong.push('cut: ' + text);
  texts.forEach(([one, a], i) => texts.slice(i + 1).forEach(([other, b]) => {
    const across = Math.min(a.right, b.right) - Math.max(a.left, b.left);
    const down = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
    if (across > 2 && down > 0.5 * Math.min(a.height, b.height)) wrong.push(one + ' over ' + other);
  }));
  return [r.height, wrong];
});
"""
# Tables and texts that are wider than what they stand in.
TOO_WIDE = """
return [...document.querySelectorAll('table, pre, p, h1, h2')].filter(e => e.getBoundingClientRect().width > 0
  && e.getBoundingClientRect().right > document.documentElement.clientWidth + 1).map(e => e.id || e.textContent);
"""


class Browser:
    """A page in Chromium, of the given size in pixels."""

    def __init__(self, driver: webdriver.Chrome) -> None:
        self.driver = driver

    def forget(self) -> None:
        """Leaves the page, with what it fetched and what was said of it."""
        self.driver.get("about:blank")
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "", "features": []})
        self.driver.execute_cdp_cmd("Network.clearBrowserCache", {})
        self.fetched()
        self.complaints()

    def look(self, url: str, width: int = 1200, dark: bool = False) -> None:
        """Opens `url` in a window of that width, preferring dark or light."""
        size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 500}
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [scheme]})
        self.driver.get(url)

    def print(self) -> None:
        """Lays the page out for paper of 210 mm."""
        size = {"width": 794, "height": 1123, "deviceScaleFactor": 1, "mobile": False}
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print", "features": []})

    def badly_laid_out(self) -> list[str]:
        """What is wrong with the figures that are shown, less than 200 pixels high, cut or on one another; and what is
        wider than the page.
        """
        wrong = []
        for height, texts in self.driver.execute_script(FIGURES_SHOWN):
            wrong += [f"{height:.0f} pixels high"] if height < 200 else []
            wrong += [" ".join(text.split()) for text in texts]
        return wrong + [f"too wide: {text}" for text in self.driver.execute_script(TOO_WIDE)]

    def figures(self) -> int:
        """How many figures are shown."""
        return len(self.driver.execute_script(FIGURES_SHOWN))

    def text(self) -> str:
        """What can be read on the page, the labels that a style sheet puts before cells included."""
        labels = """return [...document.querySelectorAll('[data-label]')].filter(
            e => getComputedStyle(e, '::before').content !== 'none').map(e => e.dataset.label).join(' ')"""
        shown = self.driver.execute_script("return document.body.innerText")
        return f"{shown}\n{self.driver.execute_script(labels)}"

    def fetched(self) -> list[str]:
        """Every URL asked for since the last call, but for data within the page and the browser's own pages."""
        messages = [json.loads(entry["message"])["message"] for entry in self.driver.get_log("performance")]
        urls = [m["params"]["request"]["url"] for m in messages if m["method"] == "Network.requestWillBeSent"]
        return [url for url in urls if not url.startswith(("data:", "blob:", "chrome:", "about:"))]

    def complaints(self) -> list[str]:
        """What the console has said since the last call, errors and warnings."""
        return [entry["message"] for entry in self.driver.get_log("browser") if entry["level"] in ("SEVERE", "WARNING")]


@contextmanager
def open_browser(profile: Path) -> Iterator[Browser]:
    """Chromium with an empty profile. Without one on this machine the test is skipped, or fails where it must not be
    (METAID_BROWSER=required, which .ci/run sets).
    """
    chromium, driver = shutil.which("chromium"), shutil.which("chromedriver")
    if chromium is None or driver is None:
        needs = "needs chromium and chromedriver (Debian: apt-get install chromium chromium-driver)"
        (pytest.fail if os.environ.get("METAID_BROWSER") == "required" else pytest.skip)(needs)
    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    for flag in (*FLAGS, f"--user-data-dir={profile}"):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    running = webdriver.Chrome(options, Service(driver))
    try:
        yield Browser(running)
    finally:
        running.quit()


@contextmanager
def served(store: Store) -> Iterator[str]:
    """The dashboard's address while it is served."""
    from metaid.show import make_dashboard  # takes a second to load

    with make_dashboard(store, 0) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.02,))  # s until it sees that it is over
        thread.start()
        try:
            yield f"http://{server.server_address[0]}:{server.server_port}"
        finally:
            server.shutdown()
            thread.join()


def wait_for(browser: Browser, text: str) -> None:
    """Until the page shows `text`; the dashboard draws itself after it has loaded."""
    deadline = time.monotonic() + 60
    while text not in browser.text():
        assert time.monotonic() < deadline, f"the page never showed {text!r}: {browser.text()[:500]}"
        time.sleep(0.1)
