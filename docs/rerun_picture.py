"""`python -m docs.rerun_picture RECORDING FILE.jpg`: a recording in Rerun's viewer, as the manual shows it.

`paani logs view RECORDING --rerun` converts it, and Chromium draws the viewer. Needs the extras `rerun` and `dev`.
"""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np

from paani_tools.bench.deck.browser import find_chromium, launched

SIZE = {"width": 1600, "height": 950}
PAGE_PORT, DATA_PORT = 9190, 9976
DRAWN_S = 45.0  # in which a machine without a graphics processor has drawn it
QUALITY = 88
SOFTWARE = ("--enable-unsafe-swiftshader", "--use-angle=swiftshader", "--ignore-gpu-blocklist")


async def take_picture(converted: Path) -> bytes:
    """The viewer of this machine alone, with everything loaded; PNG."""
    chromium = find_chromium()
    if chromium is None:
        raise SystemExit("no Chromium on this machine")
    viewer = await asyncio.create_subprocess_exec(
        "rerun", str(converted), "--serve-web", "--bind", "127.0.0.1", "--web-viewer-port", str(PAGE_PORT),
        "--port", str(DATA_PORT), start_new_session=True,
    )  # fmt: skip
    try:
        async with launched(chromium, SOFTWARE) as browser:
            page = await browser.new_page(viewport=SIZE, color_scheme="dark")
            await asyncio.sleep(3.0)
            source = f"rerun%2Bhttp://127.0.0.1:{DATA_PORT}/proxy"
            await page.goto(f"http://127.0.0.1:{PAGE_PORT}/?url={source}&renderer=webgl&hide_welcome_screen=1")
            await asyncio.sleep(DRAWN_S)
            return bytes(await page.screenshot(timeout=120_000))
    finally:
        os.killpg(viewer.pid, signal.SIGTERM)  # its starter, and the viewer itself
        await viewer.wait()


def main(recording: Path, file: Path) -> None:
    """Convert, look, and write the picture."""
    with tempfile.TemporaryDirectory() as folder:
        converted = Path(folder) / "drive.rrd"
        words = ("logs", "view", str(recording), "--rerun", "--out", str(converted))
        subprocess.run([sys.executable, "-m", "paani", *words], check=True)
        png = asyncio.run(take_picture(converted))
    bgr = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)
    cv2.imwrite(str(file), bgr, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
