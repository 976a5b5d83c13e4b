"""Synthetic sequences: their truth is true."""

import numpy as np
import pytest
import unsmear
from unsmear import synthetic

TEXTURE = synthetic.texture((120, 130), seed=2, exponent=2.0)
SHAPE = (70, 76)
MOTIONS = {
    "translation": lambda **o: synthetic.translation(
        TEXTURE, (1.7, -0.6), shape=SHAPE, **o
    ),
    "accelerated": lambda **o: synthetic.translation(
        TEXTURE, (1.0, 0.4), acceleration=(0.3, -0.2), shape=SHAPE, **o
    ),
    "zoom": lambda **o: synthetic.zoom(TEXTURE, 0.03, shape=SHAPE, **o),
    "rotation": lambda **o: synthetic.rotation(TEXTURE, 3.0, shape=SHAPE, **o),
    "shake": lambda **o: synthetic.shake(TEXTURE, 2.0, shape=SHAPE, **o),
}


def _warped_back(frame: np.ndarray, flow: np.ndarray) -> np.ndarray:
    y, x = np.mgrid[: frame.shape[0], : frame.shape[1]].astype(float)
    return unsmear._unsmear.sample(
        frame, y + flow[..., 1], x + flow[..., 0], 5, "replicate"
    )


@pytest.mark.parametrize("name", MOTIONS)
def test_flow_carries_each_frame_into_the_next(name: str) -> None:
    s = MOTIONS[name]()
    for t in range(2):
        back = _warped_back(s.sharp[t + 1], s.flow[t])
        inside = s.visible[t].copy()
        inside[:8], inside[-8:], inside[:, :8], inside[:, -8:] = (
            False,
            False,
            False,
            False,
        )
        # Interpolating an interpolated texture costs 1e-3 rms; half a pixel of wrong
        # flow costs 20 times that (the next assertion).
        error = (back - s.sharp[t])[inside]
        assert np.sqrt((error**2).mean()) < 3e-3
        wrong = _warped_back(s.sharp[t + 1], s.flow[t] + 0.5) - s.sharp[t]
        assert np.sqrt((wrong[inside] ** 2).mean()) > 1e-2


def test_flow_has_the_right_sign_and_axes() -> None:
    s = synthetic.translation(TEXTURE, (2.0, -1.0), shape=SHAPE)
    np.testing.assert_allclose(s.flow[1], np.broadcast_to([2.0, -1.0], (*SHAPE, 2)))
    # What was at (x, y) is at (x + 2, y - 1) one frame later.
    moved = s.sharp[2][20:40, 30:50]
    np.testing.assert_allclose(moved, s.sharp[1][21:41, 28:48], atol=1e-9)
    turned = synthetic.rotation(TEXTURE, 2.0, shape=(61, 61)).flow[1]
    # From right to down: right of the middle moves down.
    assert turned[30, 60, 1] > 1 and abs(turned[30, 30]).max() < 1e-6


def test_velocity_is_the_derivative_of_the_motion() -> None:
    s = synthetic.rotation(TEXTURE, 3.0, shape=(61, 61))
    y, x = np.mgrid[-30:31, -30:31]
    omega = np.radians(3.0)
    np.testing.assert_allclose(s.velocity[1][..., 0], -omega * y, atol=1e-5)
    np.testing.assert_allclose(s.velocity[1][..., 1], omega * x, atol=1e-5)


def test_exposure_integrates_the_motion() -> None:
    s = synthetic.translation(
        TEXTURE, (6.0, 0.0), shape=SHAPE, exposure=0.5, n_subframes=96, n_frames=1
    )
    # Half of 6 px: a box of 3 px along x, here as the mean of its 96 samples.
    offsets = ((np.arange(96) + 0.5) / 96 - 0.5) * 3.0
    y, x = np.mgrid[:70, :76].astype(float)
    box = np.mean(
        [unsmear._unsmear.sample(s.sharp[0], y, x - o, 5, "reflect") for o in offsets],
        axis=0,
    )
    # Beyond the window the box sees a mirror instead of the texture.
    np.testing.assert_allclose(box[:, 20:-20], s.blurred[0][:, 20:-20], atol=1e-6)
    still = synthetic.translation(TEXTURE, (6.0, 0.0), shape=SHAPE)
    np.testing.assert_array_equal(still.blurred, still.sharp)


def test_layers_move_apart_and_hide_each_other() -> None:
    opacity = np.zeros((40, 40), dtype=bool)
    opacity[10:30, 10:30] = True
    s = synthetic.layers(
        TEXTURE,
        synthetic.texture((40, 40), seed=5),
        opacity,
        shape=(61, 61),
        background_motion=synthetic.translating((0.0, 0.0)),
        foreground_motion=synthetic.translating((4.0, 0.0)),
    )
    assert tuple(s.flow[1][30, 30]) == (4, 0) and tuple(s.flow[1][5, 5]) == (0, 0)
    # Background just right of the object is covered by the next frame.
    assert not s.visible[1][30, 42] and s.visible[1][30, 50] and s.visible[1][30, 30]


def test_noise_bits_and_seeds() -> None:
    options = {"shape": SHAPE, "noise": 3.0, "bits": 8, "exposure": 1.0, "n_frames": 2}
    a = synthetic.translation(TEXTURE, (1.0, 0.0), seed=1, **options)
    b = synthetic.translation(TEXTURE, (1.0, 0.0), seed=1, **options)
    c = synthetic.translation(TEXTURE, (1.0, 0.0), seed=2, **options)
    assert a.blurred.dtype == np.uint8 and a.blurred.tobytes() == b.blurred.tobytes()
    difference = a.blurred.astype(float) - c.blurred
    # Two independent noises of 3 grey levels and their rounding: sqrt(2 (9 + 1/12)).
    assert difference.std() == pytest.approx(4.26, rel=0.05)


def test_textures_and_waves() -> None:
    t = synthetic.texture((64, 80), seed=9)
    assert t.shape == (64, 80) and 0 <= t.min() and t.max() <= 1
    assert t.tobytes() == synthetic.texture((64, 80), seed=9).tobytes()
    wave = synthetic.plane_wave((5, 40), (0.1, 0.0), velocity=(1.0, 0.0), n_frames=2)
    np.testing.assert_allclose(wave[1, :, 1:], wave[0, :, :-1], atol=1e-12)
    np.testing.assert_allclose(wave[0, :, 10:], wave[0, :, :-10], atol=1e-12)


def test_colour_textures_keep_their_channels() -> None:
    colour = np.stack([TEXTURE, 1 - TEXTURE, TEXTURE], axis=-1)
    s = synthetic.translation(colour, (1.5, 0.0), shape=(20, 22), exposure=1.0)
    assert s.blurred.shape == (3, 20, 22, 3)
    np.testing.assert_allclose(s.blurred[..., 0], 1 - s.blurred[..., 1], atol=1e-12)


def _grey_before_colour() -> synthetic.Scene:
    still = synthetic.zooming(0)
    colour = np.stack([TEXTURE] * 3, axis=-1)
    back, front = synthetic.Layer(colour, still), synthetic.Layer(TEXTURE, still)
    return synthetic.Scene((back, front), SHAPE)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: synthetic.texture((0, 4)), "shape"),
        (lambda: synthetic.translation(TEXTURE, (np.nan, 0), shape=SHAPE), "velocity"),
        (lambda: MOTIONS["zoom"](exposure=-1), "exposure"),
        (lambda: MOTIONS["zoom"](n_frames=0), "n_frames"),
        (lambda: MOTIONS["zoom"](noise=-1), "noise"),
        (lambda: MOTIONS["zoom"](bits=16), "bits"),
        (lambda: synthetic.translation(TEXTURE[0], (1, 0), shape=SHAPE), "texture"),
        (lambda: synthetic.shake(TEXTURE, 1.0, shape=SHAPE, period=0), "period"),
        (
            lambda: synthetic.Layer(TEXTURE, synthetic.zooming(0), TEXTURE[1:]),
            "opacity",
        ),
        (
            lambda: synthetic.Layer(TEXTURE, synthetic.zooming(0), 2.0 + TEXTURE),
            r"opacity must be in \[0, 1\]",
        ),
        (lambda: synthetic.Layer(TEXTURE * np.nan, synthetic.zooming(0)), "finite"),
        (lambda: synthetic.Scene((), SHAPE), "layers"),
        (lambda: synthetic.translation(TEXTURE, (1, 0), shape=(0, 5)), "shape"),
        (_grey_before_colour, "channels"),
    ],
)
def test_bad_input_is_named(call, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        call()
