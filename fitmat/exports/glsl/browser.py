"""The browser: Chromium without a window, in which shaders run, where there is one.

It knows no material: a page goes in, what the page writes of itself comes out.
"""

import html
import os
import re
import shutil
import signal
import subprocess
import tempfile
from pathlib import Path

from fitmat.errors import OutputError

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
"""What its program may be called."""

FLAGS = (
    "--headless",
    "--no-sandbox",  # the page is fitmat's own, and containers grant no sandbox
    "--disable-gpu-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--virtual-time-budget=100000",
    "--dump-dom",
)
"""Shaders on the processor, the same on every machine; nothing is fetched."""

PATIENCE = 300.0
"""Seconds after which it is stopped."""

_WRITTEN = re.compile(r'<pre id="written">(.*?)</pre>', re.DOTALL)


def program() -> str | None:
    """The path of Chromium; None where there is none."""
    return next((found for name in NAMES if (found := shutil.which(name))), None)


def written(page: str, browser: str) -> str:
    """What a page's scripts put into its `<pre id="written">`.

    Args:
        page: HTML.
        browser: From `program`.

    Raises:
        OutputError: the browser does not start, takes too long, or the page writes nothing.
    """
    with tempfile.TemporaryDirectory(prefix="fitmat-browser-", ignore_cleanup_errors=True) as folder:
        file = Path(folder) / "page.html"
        file.write_text(page, encoding="utf-8")
        command = [browser, *FLAGS, f"--user-data-dir={folder}/profile", file.as_uri()]
        shown = _run(command)
    found = _WRITTEN.search(shown)
    if found is None or not found[1]:
        raise OutputError(f"{browser}: the page wrote nothing, expected its results. Leave it out with --no-verify.")
    return html.unescape(found[1])


def _run(command: list[str]) -> str:
    """Standard output of a command, whose own processes end with it."""
    try:
        with subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, start_new_session=True
        ) as running:
            try:
                return running.communicate(timeout=PATIENCE)[0].decode("utf-8", "replace")
            except BaseException as error:
                os.killpg(running.pid, signal.SIGKILL)
                if not isinstance(error, subprocess.TimeoutExpired):
                    raise
                why = f"it did not end within {PATIENCE:g} s"
    except OSError as error:
        why = error.strerror or str(error)
    raise OutputError(f"{command[0]} cannot run a shader ({why}); leave that out with --no-verify.")
