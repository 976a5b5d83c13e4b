"""Removal of known motion blur, pixel by pixel."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from unsmear import _deblur_methods, _unsmear
from unsmear._channels import Channels
from unsmear._tone import tone_of
from unsmear.motion_found import motion_found
from unsmear.plot import _notebook

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from unsmear._progress import Progress

METHODS = ("tv", "fast", "wiener", "tikhonov", "richardson-lucy", "thesis")

THESIS_REGULARIZATION = 0.02
"""r of the founding work."""


@dataclass(frozen=True)
class DeblurResult:
    """A restored picture and how it was made.

    Attributes
    ----------
    image : ndarray
        Like the input in shape, type and range. NaN where too little is known.
    report : dict
        Plain data (JSON-able): ``method``, ``exposure`` (frames), ``turn`` (degrees by
        which the flow was turned), ``noise`` (standard deviation in the units of the
        input, None if not used), ``regularization`` (in the units of the parameter,
        None if there was none or it followed the picture),
        counts of copied pixels (``unknown_pixels``, ``still_pixels``,
        ``too_long_pixels``), ``pixels``, ``version``, ``warnings`` (list of str). The
        iterative methods: ``iterations``, ``residual`` (root mean square of A x - b,
        units of the input), ``mismatch`` (residual over noise), ``model_mismatch``
        (whether that says that the motion or the exposure is wrong somewhere),
        ``occluded_pixels`` (not believed). "wiener": ``reach`` (px). "thesis":
        ``degree``.
    """

    image: NDArray[Any]
    report: dict[str, Any]

    def _repr_html_(self) -> str:
        return _notebook.picture_html(self.image, self.report)


def deblur(
    image: ArrayLike,
    flow: ArrayLike,
    *,
    exposure: float | Literal["auto"] = 1.0,
    turn: float | Literal["auto"] = "auto",
    method: str = "tv",
    acceleration: ArrayLike | None = None,
    weights: ArrayLike | None = None,
    noise: float | None = None,
    regularization: float | None = None,
    gamma: float | str | None = None,
    degree: int = 4,
    channel_axis: int | None = None,
    progress: Progress | None = None,
) -> DeblurResult:
    r"""Remove the motion blur that a known flow caused.

    Parameters
    ----------
    image : array_like of shape (H, W), or colour with ``channel_axis``
        The blurred picture. Integers of any depth, or floats of any scale. NaN is
        unknown.
    flow : array_like of shape (H, W, 2)
        Velocity ``(u, v)`` at mid-exposure, px/frame, x to the right, y downwards.
        Pixels of unknown (NaN) motion are copied, and counted in the report.
    exposure : float or "auto", default 1.0
        Fraction of the frame interval the shutter was open; > 0. "auto" finds it, and
        with it a common error in the length of the flow, in the blur of the picture;
        see `unsmear.estimate_exposure`.
    turn : float or "auto", default "auto"
        Degrees, from right to down, by which the flow is turned before it is used.
        "auto" finds one angle for the whole picture, of 5 to 15 degrees, in its blur,
        and leaves the flow as it is unless that is clear ("thesis" always does): a
        flow that runs 10 degrees beside the blur costs four fifths of the gain.
    method : str, default "tv"
        "tv": total variation through the exact operator of the motion; best of these,
        or within .4 dB of "fast", in every case measured. "fast": the same with less
        than half the iterations, about 1 dB less, and no less where noise is strong
        (5 of 255 grey levels). Where most of what moves is blurred by 8 px or less (4
        px, if neighbours move differently) "tv" uses a finer operator, which gains up
        to 5 dB more and takes two to four times as long. "tikhonov": the operator of
        "fast" with a quadratic prior; rings more. "richardson-lucy": likeliest
        non-negative picture, for comparison.
        "wiener": the best finite inverse of each pixel's blur along its streamline;
        local. "thesis": the founding method exactly. **It makes pictures worse** (1 to
        12 dB in every case measured) and leaves a black border of 9 or 10 px: its
        inverse is sampled at the size of its kernel and so wraps round itself, it
        shifts the picture, dims it by 1/(1 + r), and rounds lengths. Kept for
        reference.
    acceleration : array_like of shape (H, W, 2), optional
        Change of the velocity at a fixed pixel, px/frame^2, as for uneven hand shake.
        Default: a steady field. Unused by "wiener" and "thesis".
    weights : array_like of shape (H, W), optional
        How far each pixel is to be believed, in [0, 1]. Default: 1. Unused by "wiener"
        and "thesis".
    noise : float, optional
        Standard deviation of the noise in the units of ``image``; >= 0. Default:
        measured in the picture, where motion leaves no texture.
    regularization : float, optional
        Strength > 0; then it is used as it is. "tv", "fast": lambda in the units of
        ``image``; "tikhonov": lambda, without unit; default from the noise and, for
        total variation, from what the model leaves unexplained. "wiener": r against
        the power :math:`|K|^2 \le 1` of the blur; default from the noise and the
        strength of the detail around each pixel. "thesis": 0.02 as in the founding
        work.
    gamma : float or "srgb", optional
        How light was coded: ``code = light^(1 / gamma)``, white 1 (integers: their
        largest value), or sRGB's law. Motion adds light; the difference shows where
        bright meets dark. Default: the picture is restored as it is, which is right
        for linear data. Unused by "wiener" and "thesis".
    degree : int, default 4
        Interpolation degree 1 to 4 of "thesis"; unused otherwise.
    channel_axis : int, optional
        Axis of 1 or 3 colour channels. Default: the picture is grey.
    progress : callable, optional
        Called with the share done in [0, 1]; an exception it raises cancels the call.

    Returns
    -------
    DeblurResult
        ``image`` like the input (integers rounded and clipped to their range, floats
        not clipped) and ``report``. No motion gives the input back bit for bit.

    Raises
    ------
    ValueError
        If shapes do not match, a parameter is out of range, ``method`` is not known,
        or unknown pixels would have to be stored as integers.
    TypeError
        If an array is not of real numbers.

    Notes
    -----
    "tv" finds the picture x, padding around it included, that minimises

    .. math:: \tfrac12 \sum_i w_i \rho((A x - b)_i)
              + \tfrac{\lambda}{p} \sum \operatorname{tr} (J + \epsilon^2 I)^{p/2},

    A the mean over the exposure along each pixel's own curved path, :math:`\rho` a
    square or Cauchy's function, J the structure tensor of x over 3 x 3 px, p = 1/2
    (1, convex, where the motion proves wrong), by iteratively reweighted least squares
    with conjugate gradients, at half size first. Grey levels are those of the picture
    scaled to standard deviation 50, so that a I + b is restored like I. Data whose path
    crosses a jump of the flow are not believed, clipped ones (white of integers) only
    as lower bounds, and unknown (NaN) ones not at all: what they would say of a pixel
    is taken from others that its light fell on, and where less than a quarter of it
    fell on known pixels the result is NaN. Iterations couple all pixels, faintly: an
    unknown pixel changes far ones by a grey level or so in fine texture, less elsewhere
    ("wiener" keeps them bit for bit).

    Blur below 1/2 px is left alone bit for bit, fading in up to 1 px; beyond 200 px
    it is left alone too. "wiener" applies, along the streamline through p on which
    the blur is a box of :math:`L = e |v(p)|` px, the kernel h of 2 ceil(2 L) + 17
    taps, :math:`\sum h = 1`, that minimises

    .. math:: \int S |1 - K H|^2 + \sigma^2 |H|^2 \, d\omega,
              \qquad K = \frac{\sin(\omega L / 2)}{\omega L / 2},

    S being the spectrum :math:`c / |\omega|^2` of natural pictures averaged across the
    motion, or constant if ``regularization`` is given.

    References
    ----------
    S. Lefkimmiatis, A. Roussos, P. Maragos, M. Unser, SIAM J. Imaging Sci. 8 (2015)
    1090-1122, doi:10.1137/14098154X. L. I. Rudin, S. Osher, E. Fatemi, Physica D 60
    (1992) 259-268, doi:10.1016/0167-2789(92)90242-F. W. H. Richardson, J. Opt. Soc. Am.
    62 (1972) 55-59, doi:10.1364/JOSA.62.000055. B. R. Hunt, IEEE Trans. Computers C-22
    (1973) 805-812, doi:10.1109/TC.1973.5009169. N. Levinson, J. Math. Phys. 25 (1946)
    261-278, doi:10.1002/sapm1946251261. C. Texin, MIT MEng thesis, 2007, section 4.2.

    Examples
    --------
    >>> import numpy as np, unsmear
    >>> flow = np.full((64, 64, 2), (6.0, 2.0))
    >>> sharp = np.kron(np.eye(4), np.ones((16, 16)))
    >>> blurred = unsmear.blur(sharp, flow)
    >>> restored = unsmear.deblur(blurred, flow).image
    >>> bool(np.std(restored - sharp) < 0.2 * np.std(blurred - sharp))
    True
    """
    if method not in METHODS:
        names = ", ".join(repr(name) for name in METHODS)
        raise ValueError(f"method must be one of {names}, got {method!r}")
    channels = Channels(image, channel_axis)
    channels.flow(flow)  # checks its shape
    share = None if exposure == "auto" else _number(exposure, "exposure")
    if share is not None and share <= 0:
        raise ValueError(f"exposure must be finite and positive, got {exposure}")
    # The founding method takes what it is given.
    angle = None if turn == "auto" else _number(turn, "turn")
    motion = motion_found(
        image,
        flow,
        acceleration,
        exposure=share,
        turn=0.0 if angle is None and method == "thesis" else angle,
        noise=noise,
        channel_axis=channel_axis,
    )
    if method == "thesis":
        r = THESIS_REGULARIZATION if regularization is None else float(regularization)
        planes, report = _deblur_methods.thesis(
            channels, motion.flow, motion.exposure, degree, r, progress
        )
    elif method == "wiener":
        planes, report = _deblur_methods.wiener(
            channels, motion.flow, motion.exposure, noise, regularization, progress
        )
    else:
        planes, report = _deblur_methods.variational(
            channels,
            motion.flow,
            method,
            motion.exposure,
            acceleration=motion.acceleration,
            weights=weights,
            noise=noise,
            regularization=regularization,
            tone=tone_of(gamma),
            progress=progress,
        )
    report = {
        "method": method,
        "exposure": motion.exposure,
        "turn": motion.turn,
        **report,
        "pixels": int(np.prod(channels.array.shape[1:])),
        "version": _unsmear.__version__,
    }
    report["warnings"] = _deblur_methods.warnings_of(report) + motion.warnings()
    if motion.found is not None:
        report["exposure_found"] = motion.found.report()
    return DeblurResult(channels.restore(planes), report)


def _number(value: float | str, argument: str) -> float:
    if isinstance(value, str):
        raise ValueError(f"{argument} must be 'auto' or a number, got {value!r}")
    if not np.isfinite(value):
        raise ValueError(f"{argument} must be finite, got {value}")
    return float(value)
