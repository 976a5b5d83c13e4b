"""The founding method's NumPy oracle: mathematics first, then the recorded listings.

Tolerances. Both sides work in float64 (eps 2.2e-16) on the same formulas, so they
differ by the rounding of transforms and sums of 1e2 to 1e4 terms: up to 1e-13 of the
largest value is seen. Velocities divide by |R|^2 and |grad phi|^2, whose smallest
values amplify that: up to 5e-13 is seen. Each bound leaves room for another FFT or
mathematics library; a wrong tap, shift or sign moves results by 1e-3 and more.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, Literal

import imageio.v3 as iio
import numpy as np
import pytest
from numpy.typing import NDArray
from reference import thesis_deblur, thesis_flow
from reference.convolve import convolve_same
from reference.golden import assert_close, golden, ours
from reference.psf import fspecial_motion

Array = NDArray[Any]

ROOT = Path(__file__).resolve().parent.parent
DATA = Path(os.environ.get("UNSMEAR_TEST_DATA", ROOT.parent / "shared" / "data"))
YOSEMITE = DATA / "barron" / "yosemite_clouds"

LINEAR = 1e-12  # transforms and sums
RATIO = 1e-11  # phase gradients and velocities
LIMITS = (5.0, 2.0)
LEAST = 10 / 12

# How the recordings treated static pixels.
LISTING: Literal["image+velocity"] = "image+velocity"


# Flow


def test_phase_gradient_of_a_plane_wave() -> None:
    kx, ky, kt = 0.7, -0.4, 0.3
    t, y, x = np.mgrid[:9, :9, :9]
    wave = 5.0 * np.exp(1j * (kx * x + ky * y + kt * t))
    inside = (slice(2, -2),) * 3
    phi_x, phi_y, phi_t = (p[inside] for p in thesis_flow.phase_gradient(wave))

    def seen(k: float) -> Any:
        """Answer of the five-tap derivative to a frequency, exact in the interior."""
        return (8.0 * np.sin(k) - np.sin(2.0 * k)) / 6.0

    np.testing.assert_allclose(phi_x, seen(kx), rtol=1e-13)
    np.testing.assert_allclose(phi_y, seen(ky), rtol=1e-13)
    np.testing.assert_allclose(phi_t, seen(kt), rtol=1e-13)
    un, vn = thesis_flow.component_velocity(phi_x, phi_y, phi_t)
    np.testing.assert_allclose(un * phi_x + vn * phi_y + phi_t, 0.0, atol=1e-14)
    np.testing.assert_allclose(un * phi_y - vn * phi_x, 0.0, atol=1e-14)


def test_kernel_lives_on_an_open_disc_and_sums_to_one() -> None:
    kernel = thesis_flow.spatial_kernel((20, 24), 0.1, 5.2, 30.0)
    row, column = np.mgrid[-10:10, -11:13]  # the middle is (H/2, W/2 - 1)
    # Radius round(5.2) = 5; (3, 4) and (5, 0) lie on the circle and are left out.
    np.testing.assert_array_equal(kernel != 0.0, row**2 + column**2 < 25)
    assert kernel.sum() == pytest.approx(1.0, abs=1e-14)


@pytest.mark.parametrize("shape", [(3, 12, 16), (4, 11, 14), (5, 10, 13), (2, 9, 9)])
def test_filtering_is_direct_convolution(shape: tuple[int, int, int]) -> None:
    rng = np.random.default_rng(7)
    frames = rng.normal(size=shape)
    kernel = rng.normal(size=shape[1:]) + 1j * rng.normal(size=shape[1:])
    taps = rng.normal(size=shape[0])
    response = thesis_flow.filter_in_space(thesis_flow.frame_spectra(frames), kernel)
    direct = np.stack([convolve_same(frame, kernel) for frame in frames])
    assert_close(response, direct, LINEAR)
    line = direct.reshape(shape[0], -1)
    in_time = convolve_same(line, taps[:, None]).reshape(shape)
    assert_close(thesis_flow.filter_in_time(direct, taps), in_time, LINEAR)


def test_flow_ignores_contrast_and_reverses_with_time() -> None:
    frames = np.random.default_rng(3).normal(size=(3, 15, 18))
    forward = thesis_flow.flow(frames, 0.15)
    # Powers of two scale without rounding, and every ratio of them is the same.
    np.testing.assert_array_equal(thesis_flow.flow(frames * 4.0, 0.15), forward)
    backward = thesis_flow.flow(frames[::-1], 0.15)
    for there, back in zip(forward, backward, strict=True):
        assert_close(-back, there, RATIO)


def test_flow_of_nothing_is_unknown() -> None:
    for component in thesis_flow.flow(np.zeros((3, 8, 10)), 0.15):
        assert np.isnan(component).all()


@pytest.mark.parametrize("name", ["of_a", "of_b", "of_c", "of_d"])
def test_flow_stages_match_the_recordings(name: str) -> None:
    stored = golden(name)
    frames = ours(stored["I"])
    f0, beta = stored["f0"].item(), stored["beta"].item()
    moving = thesis_flow.moving_pixels(frames)
    np.testing.assert_array_equal(moving, stored["static_mask"])
    np.testing.assert_array_equal(frames * moving, ours(stored["I_zeroed"]))
    sigma = thesis_flow.filter_sigma(f0, beta)
    assert sigma == pytest.approx(stored["sigma"].item(), rel=1e-15)
    angles = thesis_flow.filter_angles(f0, sigma)
    assert_close(angles, stored["w0deg"][0], 1e-15)
    taps = thesis_flow.temporal_taps(len(frames), sigma)
    assert_close(taps, stored["gt"][0], 1e-15)
    spectra = thesis_flow.frame_spectra(frames * moving)
    for n, angle in enumerate(angles):
        made: dict[str, Array] = {}
        shape = frames.shape[1:]
        untrimmed = thesis_flow.spatial_kernel(shape, f0, sigma, angle)
        mask = thesis_flow.frequency_mask(shape, f0, sigma, angle)
        kernel = thesis_flow.trim_spectrum(untrimmed, mask)
        made |= {"gabor_untrimmed": untrimmed, "gmask": mask * 1.0, "gabor": kernel}
        made["I2D"] = thesis_flow.filter_in_space(spectra, kernel)
        made["R"] = thesis_flow.filter_in_time(made["I2D"], taps)
        gradient = thesis_flow.phase_gradient(made["R"])
        made |= dict(zip(("phiX", "phiY", "phiT"), gradient, strict=True))
        components = thesis_flow.component_velocity(*gradient)
        made["Vxn"], made["Vyn"] = (c * moving for c in components)
        for key in made.keys() & stored.keys():
            expected = stored[key][..., n]
            expected = expected if expected.ndim == 2 else ours(expected)
            linear = key in ("gabor_untrimmed", "gmask", "gabor", "I2D", "R")
            assert_close(made[key], expected, LINEAR if linear else RATIO)


@pytest.mark.parametrize("name", ["of_a", "of_b", "of_c", "of_d", "valid_vel"])
@pytest.mark.parametrize("axis", ["x", "y"])
def test_gates_and_means_match_the_recordings(name: str, axis: str) -> None:
    stored = golden(name)
    components = ours(stored[f"V{axis}n"])
    over_filters = thesis_flow.gate(components, 0, *LIMITS)
    if f"V{axis}d4" in stored:
        assert_close(over_filters, ours(stored[f"V{axis}d4"]), LINEAR)
    means = thesis_flow.mean_of_rest(over_filters, 0, LEAST)
    assert_close(means, ours(stored[f"V{axis}ns"]), LINEAR)
    over_frames = thesis_flow.gate(means, 0, *LIMITS)
    assert_close(over_frames, ours(stored[f"V{axis}d3"]), LINEAR)
    result = thesis_flow.mean_of_rest(over_frames, 0, LEAST)
    assert_close(result, stored[f"V{axis}"], LINEAR)
    if f"V{axis}15" in stored:
        tight = thesis_flow.combine(components, (1.5, 2.0), LEAST)
        assert_close(tight, stored[f"V{axis}15"], LINEAR)


@pytest.mark.parametrize(
    "name", ["of_a", "of_b", "of_c", "of_d", "of_48x64", "of_interp"]
)
def test_flow_matches_the_recordings(name: str) -> None:
    stored = golden(name)
    given = {"of_48x64": (0.06, 0.8), "of_interp": (0.15, 0.8)}.get(name)
    f0, beta = given or (stored["f0"].item(), stored["beta"].item())
    vx, vy = thesis_flow.flow(
        ours(stored["I"]), f0, beta, LISTING, interpolate=name == "of_interp"
    )
    assert_close(vx, stored["Vx"], RATIO)
    assert_close(vy, stored["Vy"], RATIO)


@pytest.mark.skipif(
    not YOSEMITE.is_dir(), reason=f"no Yosemite sequence under {YOSEMITE}"
)
def test_yosemite_row_of_table_5_1() -> None:
    frames = np.stack([iio.imread(YOSEMITE / f"frame_{k:02d}.png") for k in (8, 9, 10)])
    raw = (YOSEMITE / "flow_09.flo").read_bytes()
    truth = np.frombuffer(raw, "<f4", offset=12).reshape(*frames.shape[1:], 2)
    truth = truth.astype(np.float64)
    land = iio.imread(YOSEMITE / "mask_nosky_09.png") == 255
    # The thesis's figures come out with the clouds at 1 px/frame, not the usual 2.
    truth[~land] = (1.0, 0.0)
    estimate = np.stack(thesis_flow.flow(frames), axis=-1)
    speed, found = np.hypot(*np.moveaxis(truth, -1, 0)), np.hypot(*estimate.T).T
    cosine = np.sum(truth * estimate, axis=-1) / np.where(speed > 0, speed, 1) / found
    direction = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    fast, known = speed >= 0.5, np.isfinite(found)
    # The gates leave next to nothing out: one pixel of 71 707.
    assert known[fast].mean() > 0.9999
    figures = [
        (direction[where].mean(), np.abs(speed - found)[where].mean())
        for where in (fast & known, fast & known & land)
    ]
    # Recorded figures, to half a unit of their last digit. Thesis: 32.6, 20.2 degrees.
    error = np.abs(np.array(figures) - [(33.0, 1.472), (19.9, 1.728)])
    assert (error <= (0.05, 0.0005)).all(), figures


# Deblurring


def test_inverse_filters_match_the_recordings() -> None:
    stored = golden("psf")
    cases = [int(key[2:]) for key in stored if key.startswith("H_")]
    assert cases
    for k in cases:
        psf = fspecial_motion(*stored["len_theta"][k])
        spectrum, kernel = thesis_deblur.inverse_filter(psf, stored["r"].item())
        assert_close(spectrum, stored[f"H_{k:03d}"], LINEAR)
        assert_close(kernel.real, stored[f"h_{k:03d}"], LINEAR)


@pytest.mark.parametrize("degree", [1, 2, 3, 4])
@pytest.mark.parametrize("field", ["const", "vary"])
def test_deblur_matches_the_recordings(field: str, degree: int) -> None:
    stored = golden("deblur")
    image, r = stored["I"], stored["r"].item()
    vx, vy = stored["vary_Vx"], stored["vary_Vy"]
    if field == "const":
        u, v = stored["const_v"][0]
        vx, vy = np.full_like(image, u), np.full_like(image, v)
    result = thesis_deblur.deblur(image, vx, vy, degree, r)
    assert_close(result, stored[f"{field}_n{degree}"], LINEAR)


def test_deblur_lengths_and_angles_match_the_recordings() -> None:
    stored = golden("deblur")
    lengths, angles = thesis_deblur.lengths_and_angles(
        stored["vary_Vx"], stored["vary_Vy"], 3
    )
    computed = (slice(9, -10),) * 2  # the recording holds 0 in the border
    np.testing.assert_array_equal(lengths[computed], stored["vary_rlen_n3"][computed])
    assert_close(angles, stored["vary_theta_deg"], 1e-15)


def test_deblur_copies_where_motion_is_unknown_or_none() -> None:
    image = np.random.default_rng(5).normal(size=(24, 26))
    for motion in (np.nan, 0.0, 0.4):
        field = np.full(image.shape, motion)
        result = thesis_deblur.deblur(image, field, np.zeros_like(image), 1)
        np.testing.assert_array_equal(result[9:14, 9:16], image[9:14, 9:16])
        assert np.count_nonzero(result) == 5 * 7
