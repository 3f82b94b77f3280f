"""The picture of the design page in docs/page.md, taken by chromium.

    python docs/make/page_shot.py            # docs/images/page.png
    python docs/make/page_shot.py --quick    # the same into out/quick

It needs what `make test-page` installs.  The page is started as users start it, in a folder of its
own; the structures are compared first, so that there is something to see.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

from playwright.sync_api import sync_playwright
from stored import docs_folder, study_parser

CHROMIUM = "/usr/bin/chromium"
FLAGS = """
    --headless --no-sandbox --disable-gpu --disable-quic --no-first-run
    --disable-background-networking --disable-component-update --disable-sync
""".split()  # noqa: SIM905
SIZE = {"width": 1280, "height": 1180}
WAIT = 240_000  # [ms]


def taken(url: str, place: Path) -> None:
    """Compare the structures, and take the picture once the capability is there."""
    with sync_playwright() as player:
        browser = player.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        page = browser.new_page(viewport=SIZE, color_scheme="light")
        page.set_default_timeout(WAIT)
        page.goto(url)
        page.wait_for_selector(".found:not(.head)")
        page.get_by_role("button", name="Compare structures").click()
        page.wait_for_selector(".found:not(.head) >> nth=3")
        page.wait_for_selector(".hint:has-text('binds')")
        page.wait_for_selector(".chip:has-text('Verified')")
        page.mouse.move(5, 5)
        page.evaluate("window.scrollTo(0, 0)")
        page.wait_for_timeout(1500)
        page.screenshot(path=place)
        browser.close()


def main() -> None:
    arguments = study_parser(__doc__).parse_args()
    place = docs_folder(arguments.quick) / "images" / "page.png"
    with tempfile.TemporaryDirectory() as folder:
        server = subprocess.Popen(
            [sys.executable, "-m", "stillhook", "page", "--no-open", "subsea-crane"],
            cwd=folder,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONUNBUFFERED": "1"},
        )
        try:
            assert server.stdout is not None
            taken(server.stdout.readline().split()[-1], place)
        finally:
            server.send_signal(signal.SIGINT)
            server.wait()
    print(place)


if __name__ == "__main__":
    main()
