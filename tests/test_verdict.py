"""What of a restoration is used."""

from __future__ import annotations

import numpy as np
import pytest
from unsmear.restoration.twin_frames import Twins
from unsmear.restoration.verdict import judge


@pytest.mark.parametrize(("status", "far"), [("small", 0.0), ("ok", 1.0)])
def test_an_exposure_assumed_for_short_blur_is_used_for_that(
    status: str, far: float
) -> None:
    rng = np.random.default_rng(1)
    restored = rng.normal(90, 20, (40, 60)).astype(np.float32)
    blurred = (restored + rng.normal(0, 9, restored.shape)).astype(np.float32)
    blur = np.full(restored.shape, 2.0, np.float32)
    blur[:, 40:] = 8.0
    blur[:, :5] = np.nan
    moving = np.isfinite(blur)
    verdict = judge(blurred, restored, Twins([restored], moving), blur, status)
    assert (verdict.share[:, 5:40] == 1).all()
    assert (verdict.share[:, 40:] == far).all()
    assert (verdict.share[:, :5] == 0).all()
    assert ("exposure is not known" in verdict.report["verdict"]) == (far == 0)
