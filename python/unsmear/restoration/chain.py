"""The order of the steps: one pass over a clip, frame by frame, each step when needed.

A pass measures flow on guide frames and restores data frames. In the first both are
the clip; in the second, worth its time where the motion changes much from frame to
frame and so blur differs between frames, the guides are the restored frames of the
first. Steps are computed when a frame first asks for them and forgotten when no frame
to come can: memory does not grow with the clip.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear.restoration.boundaries import believed
from unsmear.restoration.clip_exposure import ClipExposure
from unsmear.restoration.clip_motion import ClipMotion
from unsmear.restoration.line_pairing import LinePairing, as_recorded
from unsmear.restoration.looks import (
    LINES,
    NEXT,
    SHARP_STRENGTH,
    SPLINE,
    TWIN,
    WALK,
    cropped,
    walk,
)
from unsmear.restoration.memo import Memo
from unsmear.restoration.neighbours import Neighbours
from unsmear.restoration.records import Alone, Restored, Settings
from unsmear.restoration.several_frames import SeveralFrames
from unsmear.restoration.twin_frames import (
    Twins,
    choose_strength,
    of_noise,
    score,
    twins,
)
from unsmear.restoration.verdict import judge
from unsmear.restoration.walks import Walks

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from unsmear.restoration.source import Source

    Plane = NDArray[np.float32]
    Planes = NDArray[np.float32]

__all__ = ["REACH", "Chain"]

SHARPER = 1.0
"""Score of the sharper prior, relative to the other's, below which it is used."""
KEPT_BEHIND = 5
"""Frames that one looks back on, through exposures and twins of its neighbours."""
JOINED = {"given": np.inf, "ok": np.inf, "unsure": 0.9, "small": 0.0, "beyond": 0.0}
"""Ratio of the verdict below which frames are restored together, by the trust in their
exposure."""
REACH = 7
"""Frames on each side that one restored in a pass depends on: those of the motions
behind its neighbours' exposures (five), for its twins and for its neighbours' strength
one more each."""


class Chain:
    """One pass."""

    def __init__(
        self,
        source: Source,
        guide: Callable[[int], NDArray[Any]],
        settings: Settings,
    ) -> None:
        self._memo = Memo()
        self._source = source
        self._settings = settings
        self.motion = ClipMotion(
            guide,
            source.count,
            colour=source.frame(0).shape[-1] > 1,
            method=settings.flow_method,
            options=settings.flow_options,
            memo=self._memo,
        )
        self._exposure = ClipExposure(
            source,
            self.motion,
            self._memo,
            given=settings.exposure,
            noise=settings.noise,
            seed=settings.seed,
        )
        self._lines = LinePairing(source, self._memo)
        self._walks = Walks(
            source, self.motion, self._exposure, self._lines, self._memo
        )
        neighbours = Neighbours(
            source,
            self.motion,
            self._exposure,
            self._lines,
            self._walks,
            method=settings.flow_method,
            options=settings.flow_options,
        )
        self._several = SeveralFrames(
            neighbours,
            self.restored,
            self._walks.look,
            lambda index: self._exposure.exposure(index).noise,
            settings.joint // 2,
        )

    def forget_before(self, index: int, guided: int = 0) -> None:
        """Drop what no frame from ``index`` on needs.

        Results, which guide the next pass, stay for ``guided`` frames more.
        """
        first = index - KEPT_BEHIND
        self._memo.forget_before(first, "restored", first - guided)
        self._several.forget_before(first)

    def restored(self, index: int) -> Restored:
        """Return a frame restored by itself."""
        return self._memo.get("restored", index, lambda: self._restore(index))

    def unsteadiness(self, index: int) -> float:
        """Return median acceleration over median velocity where the frame moves."""
        motion = self.motion.motion(index)
        moving = self._twins(index).moving
        if not moving.any():
            return 0.0
        medians = [
            float(np.median(np.linalg.norm(field[moving], axis=-1)))
            for field in (motion.acceleration, motion.velocity)
        ]
        return medians[0] / max(medians[1], 1e-6)

    def _twins(self, index: int) -> Twins:
        return self._memo.get("twins", index, lambda: self._find_twins(index))

    def _find_twins(self, index: int) -> Twins:
        motion = self.motion.motion(index)
        neighbours = []
        for other, way in ((index - 1, motion.backward), (index + 1, motion.forward)):
            back = self.motion.flow(other, index)
            if way is not None and back is not None:
                neighbours.append((self._walks.twin(other), way, back))
        exposure = self._exposure.exposure(index).value
        return twins(neighbours, motion.velocity, exposure)

    def _scores(self, index: int) -> list[float]:
        pictures, pad = self._walks.pictures(index)
        against = self._twins(index)
        return [score(cropped(picture, pad)[0], against) for picture in pictures]

    def _own_strength(self, index: int) -> float:
        noise = self._exposure.exposure(index).noise

        def choose() -> float:
            return choose_strength(WALK, self._scores(index), noise)

        return self._memo.get("strength", index, choose)

    def _strength(self, index: int) -> float:
        """Return the strength for a frame: those of it and its neighbours, 2 to 1."""
        near = [j for j in (index - 1, index + 1) if 0 <= j < self._source.count]
        logs = [2 * np.log(self._own_strength(index))]
        logs += [np.log(self._own_strength(j)) for j in near]
        return float(np.exp(sum(logs) / (len(near) + 2)))

    def _restore(self, index: int) -> Restored:
        exposure = self._exposure.exposure(index)
        motion = self.motion.motion(index)
        planes = self._source.planes(index)
        blur = exposure.value * np.linalg.norm(motion.velocity, axis=-1)
        known = blur[np.isfinite(blur)]
        report: dict[str, Any] = {
            "index": index,
            "exposure": exposure.value,
            "exposure_status": exposure.status,
            "exposure_found": {
                name: None if isinstance(item, float) and np.isnan(item) else item
                for name, item in exposure.found.items()
                if name not in ("noise", "turn")
            },
            "noise": exposure.noise / self._source.scale,
            "line_pairing": self._lines.offset(index),
            "blur_px": float(np.percentile(known, 95)) if known.size else None,
        }
        if not (np.nan_to_num(blur) > 0).any() or not self._twins(index).moving.any():
            nothing = np.zeros(blur.shape, bool)
            report["verdict"] = "left as is: nothing moves enough to be blurred"
            return Restored(planes, nothing, float("nan"), report)
        strength = self._strength(index)
        single, pad, sharp = self._single(index, strength)
        luma = self._source.luma
        verdict = judge(
            luma(index),
            self._source.luma_of(cropped(single, pad)),
            self._twins(index),
            blur,
            exposure.status,
        )
        if exposure.status == "small":
            # Short blur dims and hides nothing: little is left to the prior to guess.
            strength = min(strength, of_noise(exposure.noise, WALK))
            single, pad, sharp = self._single(index, strength)
        report |= {
            "regularization": strength / self._source.scale,
            "sharp": sharp,
            **verdict.report,
        }
        alone = Alone(single, pad, strength, verdict.share)
        return self._composed(index, (single, pad), alone, report, verdict.ratio)

    def joined(self, index: int) -> Restored:
        """Return a restored frame with what its neighbours saw of it.

        Only where the exposure is sure, or frames agree well: a wrong one is wrong for
        every frame. A frame that is hardly blurred misses little, less than neighbours
        blurred alike carry over with the errors of the flow.
        """
        before = self.restored(index)
        alone = before.alone
        if self._settings.joint == 1 or alone is None or not before.changed.any():
            return before
        if not before.ratio < JOINED[before.report["exposure_status"]]:
            return before
        picture, pad, more = self._several.restored(index)
        report = before.report | more
        return self._composed(index, (picture, pad), alone, report, before.ratio)

    def _single(self, index: int, strength: float) -> tuple[Planes, int, bool]:
        """Return the frame restored by itself, padded, and whether sharply.

        The sharper prior is better where the motion is right and worse where not: the
        twins tell.
        """
        noise = self._exposure.exposure(index).noise
        looks = [self._walks.look(index, self._taps(index))]
        pictures, pad = self._walks.pictures(index)
        if len(looks[0]["planes"]) > 1:
            way = (strength,) if strength <= WALK[TWIN] else (WALK[TWIN], strength)
            pictures, pad = walk(looks, way, noise, pad=pad)
        else:
            below = max((k for k, one in enumerate(WALK) if one <= strength), default=0)
            start = pictures[below]
            pictures, _ = walk(
                looks, (strength,), noise, pad=pad, first=NEXT, start=start
            )
        cautious = pictures[-1]
        pictures, _ = walk(
            looks,
            (SHARP_STRENGTH * strength,),
            noise,
            pad=pad,
            first=NEXT,
            start=cautious,
            sharp=True,
        )
        scores = [
            score(self._source.luma_of(cropped(one, pad)), self._twins(index))
            for one in (pictures[-1], cautious)
        ]
        if scores[0] < SHARPER * scores[1]:
            return pictures[-1], pad, True
        return cautious, pad, False

    def _taps(self, index: int) -> str:
        """Return those of a frame restored by itself.

        Lines are enough where several frames start from it, and right where blur is
        short: the exposures that are assumed there were found with them.
        """
        status = self._exposure.exposure(index).status
        joined = self._settings.joint > 1 and JOINED[status] == np.inf
        return LINES if joined or status == "small" else SPLINE

    def _composed(
        self,
        index: int,
        padded: tuple[Planes, int],
        alone: Alone,
        report: dict[str, Any],
        ratio: float,
    ) -> Restored:
        planes = self._source.planes(index)
        share = alone.share * believed(self._walks.look(index), *padded)
        changed = (share > 0) & np.isfinite(planes).all(axis=0)
        report = report | {"used_share": float(changed.mean())}
        shown = as_recorded(*padded, self._lines.offset(index))
        mixed = planes + share * (shown - planes)
        return Restored(np.where(changed, mixed, planes), changed, ratio, report, alone)
