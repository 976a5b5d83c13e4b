"""Results in notebooks: well-formed, self-contained, and showing what they hold."""

from __future__ import annotations

import base64
import io
import re
from html.parser import HTMLParser

import numpy as np
import pytest
import unsmear
from PIL import Image


class Outline(HTMLParser):
    """Checks that tags close, and keeps the pictures and the text."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.pictures: list[np.ndarray] = []
        self.text: list[str] = []

    def handle_starttag(self, tag, attributes):
        if tag == "img":
            prefix, code = dict(attributes)["src"].split(",")
            assert prefix == "data:image/png;base64"
            data = io.BytesIO(base64.b64decode(code))
            self.pictures.append(np.asarray(Image.open(data)))
        else:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)


def outline(result: object) -> Outline:
    fragment = result._repr_html_()
    assert not re.search(r"https?://|<script|<link", fragment)
    # Colours of its own would be unreadable on one of a light and a dark page.
    assert not re.search(r"(?<!background)(?<!-)\bcolor: (?!inherit)", fragment)
    parsed = Outline()
    parsed.feed(fragment)
    assert parsed.open == []
    return parsed


@pytest.fixture(scope="module")
def shot() -> unsmear.synthetic.Sequence:
    make = unsmear.synthetic
    paint = make.texture((160, 160), seed=3)
    return make.translation(
        paint, (5.0, 2.0), shape=(72, 96), exposure=0.8, n_frames=3, bits=8
    )


def test_a_flow_shows_its_colours_and_numbers(shot) -> None:
    result = unsmear.optical_flow(shot.blurred)
    seen = outline(result)
    (picture,) = seen.pictures
    # The flow itself stands at full size in the upper left corner.
    np.testing.assert_array_equal(
        picture[:72, :96], unsmear.plot.flow_to_color(result.flow)
    )
    text = " ".join(seen.text)
    assert "balanced" in text and "3 x 72 x 96" in text and "100.0% of the" in text


def test_a_flow_that_is_nowhere_known_is_shown_too() -> None:
    seen = outline(unsmear.optical_flow(np.zeros((2, 40, 40))))
    assert "unknown" in seen.text and "nothing to measure motion on" in seen.text


def test_a_large_flow_makes_a_small_picture() -> None:
    flow = np.zeros((700, 1300, 2), np.float32)
    report = {"method": "a<b", "frames": [2, 700, 1300], "index": 0, "density": 1.0}
    report |= {"seconds": 1.0, "threads": 1, "warnings": []}
    result = unsmear.FlowResult(flow, flow[..., 0], flow[..., 0] == 0, report)
    seen = outline(result)
    assert max(seen.pictures[0].shape) < 600
    assert "a<b" in seen.text, "escaped, and so text again"


@pytest.mark.parametrize("axis", [None, 2, 0])
def test_a_picture_shows_itself(shot, axis) -> None:
    image = shot.blurred[1]
    if axis is not None:
        image = np.stack([image] * 3, axis=axis)
    result = unsmear.deblur(image, shot.velocity[1], method="fast", channel_axis=axis)
    (picture,) = outline(result).pictures
    shown = (
        result.image if axis is None else np.moveaxis(result.image, axis, -1)[..., 0]
    )
    np.testing.assert_array_equal(picture[..., 0], shown)


def test_a_clip_shows_its_verdicts(shot) -> None:
    result = unsmear.deblur_sequence(shot.blurred, indices=[1], exposure=0.8)
    seen = outline(result)
    assert len(seen.pictures) == 2
    np.testing.assert_array_equal(seen.pictures[0][..., 0], result.frames[0])
    assert f"1 x {result.reports[0]['verdict']}" in seen.text
