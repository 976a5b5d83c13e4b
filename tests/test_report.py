"""The report page: exact data inside, nothing from outside, alive in a browser."""

from __future__ import annotations

import base64
import io
import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
import unsmear
from PIL import Image
from unsmear import metrics, plot

HEIGHT, WIDTH, COUNT = 48, 64, 3


@pytest.fixture
def clip() -> dict[str, object]:
    rng = np.random.default_rng(7)
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(np.float64)
    flow = np.stack([3 * np.sin(x / 9), 2 * np.cos(y / 7)], -1).astype(np.float32)
    flow[4:8, 5:9] = np.nan
    sharp = rng.integers(0, 256, (COUNT, HEIGHT, WIDTH), dtype=np.uint8)
    return {
        "frames": sharp // 2,
        "restored": np.clip(sharp, 3, None),
        "sharp": sharp,
        "flows": [flow, None, 2 * flow],
        "true_flows": [flow + 1, None, None],
        "confidences": [rng.random((HEIGHT, WIDTH)), None, None],
    }


def data_of(path: Path) -> dict:
    html = path.read_text("utf-8")
    found = re.search(r'<script id="data" type="application/json">(.*?)</script>', html)
    assert found
    return json.loads(found[1])


def picture_of(uri: str) -> np.ndarray:
    prefix = "data:image/png;base64,"
    assert uri.startswith(prefix)
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(uri[len(prefix) :]))))


def test_pictures_and_flow_survive(tmp_path, clip):
    path = tmp_path / "report.html"
    plot.report(path, **clip)
    page = data_of(path)
    assert page["size"] == [HEIGHT, WIDTH] and len(page["frames"]) == COUNT
    for i, frame in enumerate(page["frames"]):
        np.testing.assert_array_equal(
            picture_of(frame["before"])[..., 0], clip["frames"][i]
        )
        np.testing.assert_array_equal(
            picture_of(frame["after"])[..., 0], clip["restored"][i]
        )
    assert page["frames"][1]["flow"] is None
    for i in (0, 2):
        stored, flow = page["frames"][i]["flow"], clip["flows"][i]
        integers = np.frombuffer(base64.b64decode(stored["values"]), "<i2")
        values = np.where(integers == -32768, np.nan, integers * stored["scale"])
        # Rounded to the nearest step; float32 flow adds its own last bit.
        bound = stored["scale"] * 0.5001
        np.testing.assert_allclose(values.reshape(flow.shape), flow, rtol=0, atol=bound)
        assert stored["scale"] < 1e-3


def test_tables_hold_the_errors(tmp_path, clip):
    path = tmp_path / "report.html"
    plot.report(path, **clip)
    page = data_of(path)
    pictures, flow = page["tables"]
    expected = metrics.psnr(clip["restored"][2], clip["sharp"][2])
    assert pictures["rows"][2][2] == f"{expected:.2f}"
    (row,) = flow["rows"]
    assert row[2] == f"{np.sqrt(2):.3f}"  # the truth is off by (1, 1)
    (curve,) = page["curves"]
    np.testing.assert_allclose(curve["y"], np.sqrt(2), rtol=1e-5)


def test_the_page_is_self_contained(tmp_path, clip):
    path = tmp_path / "report.html"
    hostile = "</script><script>alert(1)</script>"
    plot.report(
        path, **clip, title=hostile, command=hostile, parameters={"a": np.nan, "b": [1]}
    )
    html = path.read_text("utf-8")
    assert hostile not in html
    assert not re.search(r"""(src|href)\s*=\s*["']?(https?:)?//""", html)
    assert "@import" not in html and "fetch(" not in html
    page = data_of(path)
    assert page["title"] == hostile
    parameters = page["parameters"]
    assert parameters["a"] is None and parameters["b"] == [1]
    assert parameters["versions"]["unsmear"] == unsmear.__version__
    assert {"core", "vectors", "python", "numpy"} <= set(parameters["versions"])


def test_long_clips_are_thinned(tmp_path):
    frames = np.zeros((40, 8, 9), np.uint8)
    path = tmp_path / "report.html"
    plot.report(path, frames, max_frames=5)
    page = data_of(path)
    names = [frame["label"] for frame in page["frames"]]
    assert len(names) == 5 and names[0] == "frame 0" and names[-1] == "frame 39"
    assert "5 of them shown" in page["facts"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"frames": np.zeros((4, 5))}, "frames must have shape"),
        ({"restored": np.zeros((2, 3, 4))}, "restored must have the shape of frames"),
        ({"flows": [None]}, "flows must be 3 as frames are, got 1"),
        ({"labels": ["a"]}, "labels must be 3 as frames are, got 1"),
        ({"max_frames": 0}, "max_frames must be at least 1, got 0"),
    ],
)
def test_bad_input_names_the_argument(tmp_path, clip, change, message):
    path = tmp_path / "report.html"
    with pytest.raises(ValueError, match=message):
        plot.report(path, **{**clip, **change})
    assert not list(tmp_path.iterdir())


def test_in_a_browser(tmp_path, clip):
    """The slider, the reading under the pointer, the keys and the copy button."""
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    sync_api = pytest.importorskip("playwright.sync_api", reason="no playwright")
    if chromium is None:
        pytest.skip("no Chromium on this machine")
    path = tmp_path / "report.html"
    plot.report(path, **clip, command="unsmear deblur a -o b")
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=chromium, args=["--no-sandbox"]
        )
        page = browser.new_page(color_scheme="dark")
        problems: list[str] = []
        page.on("pageerror", lambda error: problems.append(str(error)))
        page.on(
            "request",
            lambda request: (
                problems.append(request.url[:80])
                if request.url.startswith("http")
                else None
            ),
        )
        page.goto(path.as_uri())
        assert page.evaluate("document.documentElement.dataset.theme") == "dark"

        stage = page.locator("#compare-stage")
        size = stage.bounding_box()
        assert size
        stage.click(position={"x": size["width"] / 4, "y": size["height"] / 2})
        assert (
            abs(float(page.input_value("#split")) - 25) < 1.5
        )  # whole pixels of a small picture

        stage = page.locator("#flow-stage")
        size = stage.bounding_box()
        assert size
        x, y = 20, 30
        middle = {
            "x": (x + 0.5) / WIDTH * size["width"],
            "y": (y + 0.5) / HEIGHT * size["height"],
        }
        stage.hover(position=middle)
        u, v = clip["flows"][0][y, x]
        assert page.inner_text("#reading").startswith(
            f"x {x}, y {y}: u {u:.3f}, v {v:.3f}, speed {np.hypot(u, v):.3f} px/frame"
        )
        stage.focus()
        page.keyboard.press("ArrowRight")
        assert page.inner_text("#reading").startswith(f"x {x + 1}, y {y}:")

        page.locator("h1").click()
        page.keyboard.press("ArrowRight")
        assert page.inner_text("#frame-label") == "frame 1"
        assert page.locator("#motion").is_hidden()

        page.context.grant_permissions(["clipboard-read", "clipboard-write"])
        page.click("#command-block .copy")
        page.wait_for_function(
            "document.querySelector('.copy').textContent == 'copied'"
        )
        copied = page.evaluate("navigator.clipboard.readText()")
        assert copied == "unsmear deblur a -o b"
        browser.close()
    assert not problems
