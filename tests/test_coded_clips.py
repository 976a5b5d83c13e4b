"""Exposure of clips whose fine detail a codec has left out."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import unsmear
from numpy.typing import NDArray
from unsmear import synthetic
from unsmear.restoration.clip_exposure import CODED_NOISE, ClipExposure

EXPOSURE = 0.8


def coded(frames: NDArray[np.uint8], path: str) -> NDArray[np.uint8]:
    """Return frames as H.264 leaves them."""
    av = pytest.importorskip("av")
    with av.open(path, "w") as file:
        stream = file.add_stream("libx264", rate=24, options={"crf": "18"})
        stream.height, stream.width = frames.shape[1:]
        stream.pix_fmt = "yuv420p"
        for frame in frames:
            picture = av.VideoFrame.from_ndarray(
                np.repeat(frame[..., np.newaxis], 3, axis=-1), format="rgb24"
            )
            file.mux(stream.encode(picture))
        file.mux(stream.encode())
    return np.ascontiguousarray(unsmear.read_frames(path)[..., 1])


@pytest.fixture(scope="module")
def clip() -> synthetic.Sequence:
    y, x = np.mgrid[:340, :340]
    picture = 0.5 * synthetic.texture((340, 340), seed=3, exponent=1.6)
    picture += 0.4 * ((y // 23 + x // 17) % 2)
    return synthetic.translation(
        picture,
        (9.0, 4.0),
        shape=(192, 192),
        exposure=EXPOSURE,
        n_frames=3,
        noise=1.0,
        bits=8,
    )


def test_a_coded_clip_is_restored(clip: synthetic.Sequence, tmp_path: Any) -> None:
    frames = coded(clip.blurred, str(tmp_path / "clip.mp4"))
    result = unsmear.deblur_sequence(frames, indices=[1])
    report = result.reports[0]
    assert report["exposure_status"] == "ok"
    assert report["exposure"] == pytest.approx(EXPOSURE, rel=0.06)
    inner = (slice(24, -24),) * 2
    before, after = (
        np.mean((x[inner].astype(np.float64) - clip.sharp[1][inner]) ** 2)
        for x in (frames[1], result.frames[0])
    )
    assert 10 * np.log10(before / after) > 1


def answers(**by_noise: dict[str, Any]) -> Any:
    def likeliest(
        self: ClipExposure, _index: int, noise: float | None
    ) -> dict[str, Any]:
        self.asked.append(noise)  # type: ignore[attr-defined]
        return by_noise["none" if noise is None else f"noise{noise:.0f}"]

    return likeliest


UNSURE = {"status": "unsure", "likeliest": 0.06, "value": 0.06, "noise": 0.6}
OK = {"status": "ok", "likeliest": 0.8, "value": 0.8, "noise": 5.0}


@pytest.mark.parametrize(
    ("first", "given", "noise", "expected"),
    [
        pytest.param(UNSURE, None, None, [None, *CODED_NOISE], id="coded"),
        pytest.param(OK, None, None, [None], id="found"),
        pytest.param(UNSURE | {"likeliest": 0.9}, None, None, [None], id="long"),
        pytest.param(UNSURE | {"noise": 4.0}, None, None, [None], id="noisy"),
        pytest.param(UNSURE, 0.5, None, [None], id="exposure told"),
        pytest.param(UNSURE, None, 1.0, [1.0], id="noise told"),
    ],
)
def test_the_search_goes_on_where_detail_is_missing(
    monkeypatch: pytest.MonkeyPatch,
    first: dict[str, Any],
    given: float | None,
    noise: float | None,
    expected: list[float | None],
) -> None:
    found = answers(none=first, noise1=first, noise3=UNSURE, noise5=OK)
    monkeypatch.setattr(ClipExposure, "_likeliest", found)
    anything: Any = None
    exposure = ClipExposure(
        anything, anything, anything, given=given, noise=noise, seed=0
    )
    exposure.asked = []  # type: ignore[attr-defined]
    result = exposure._search(0)
    assert exposure.asked == expected  # type: ignore[attr-defined]
    # The noise stays what it was: what the restoration has to bear.
    last = OK | {"noise": 0.6} if len(expected) > 1 else first
    assert result == last
