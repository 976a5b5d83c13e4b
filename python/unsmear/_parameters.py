"""Parameters of the flow methods: names, defaults, types; merged with what came."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterable

# What each name means and why it has this value is told by `unsmear.optical_flow` and,
# with the equations, by the core.
_BALANCED: dict[str, Any] = {
    "pyramid_factor": 0.5,
    "coarsest_side": 16.0,
    "finest_level": 0,
    "warps": 6,
    "finest_warps": 2,
    "passes": 2,
    "sweeps": 10,
    "smoothness": 0.11,
    "edge_sensitivity": 2.0,
    "strongest_channel": False,
    "residual_scale": 1.0,
    "precision_scale": 0.3,
    "tau": 1.25,
    "amplitude_fraction": 0.05,
    "amplitude_floor": 0.2,
    "median_radius": 5,
    "guide_sigma": 10.0,
    "frames_each_side": 0,
    "choose_frames": False,
    "adapt_to_noise": True,
    "static_evidence": True,
    "forward_backward": False,
}

_ACCURATE: dict[str, Any] = _BALANCED | {
    "pyramid_factor": 0.75,
    "warps": 3,
    "passes": 3,
    "sweeps": 15,
    "smoothness": 0.13,
    "edge_sensitivity": 2.5,
    "strongest_channel": True,
    "residual_scale": 0.7,
    "precision_scale": 0.25,
}

_SEVERAL_FRAMES: dict[str, Any] = {"frames_each_side": 3, "choose_frames": True}

PARAMETERS: dict[str, dict[str, Any]] = {
    "fast": _BALANCED
    | {"finest_level": 1, "warps": 4, "finest_warps": 3, "smoothness": 0.1},
    "balanced": _BALANCED,
    "accurate": _ACCURATE,
    "steady": _BALANCED
    | {"smoothness": 0.088, "edge_sensitivity": 1.0, "residual_scale": 0.5}
    | _SEVERAL_FRAMES,
    "steady-accurate": _ACCURATE
    | {"smoothness": 0.104, "edge_sensitivity": 1.25, "residual_scale": 0.35}
    | _SEVERAL_FRAMES,
    "least-squares": {
        "tuning_frequency": 0.12,
        "bandwidth_octaves": 0.8,
        "orientations": 6,
        "support": 3.0,
        "amplitude_fraction": 0.02,
        "tau": 1.25,
        "neighbourhood": 4.0,
        "time_sigma": 1.5,
        "robust": 0.5,
        "passes": 2,
        "least_eigenvalue": 1e-3,
        "border": "replicate",
    },
    "fleet-jepson": {
        "tuning_frequency": 1 / 4.25,
        "bandwidth_octaves": 0.8,
        "support": 3.0,
        "amplitude_fraction": 0.05,
        "tau": 1.25,
        "window_radius": 2,
        "least_constraints": 12,
        "condition_limit": 8.0,
        "residual_limit": 0.05,
        "border": "replicate",
    },
    "thesis": {
        "tuning_frequency": 0.06,
        "bandwidth_octaves": 0.8,
        "zero_static": "none",
        "interpolate": False,
        "std_limit": 5.0,
        "distance_limit": 2.0,
        "least_fraction": 10 / 12,
    },
}

COMPONENT_PARAMETERS: dict[str, Any] = {
    "tuning_frequency": 0.15,
    "bandwidth_octaves": 0.8,
    "orientations": 6,
    "support": 3.0,
    "temporal": "steps",
    "least_steadiness": 0.0,
    "amplitude_fraction": 0.05,
    "tau": 1.25,
    "border": "replicate",
}


def merged(method: str, given: dict[str, Any]) -> dict[str, Any]:
    """Return all parameters of ``method``, defaults replaced by what was given."""
    if method not in PARAMETERS:
        known = ", ".join(repr(name) for name in PARAMETERS)
        msg = f"method must be one of {known}, got {method!r}"
        raise ValueError(msg)
    return checked(given, PARAMETERS[method], f"method {method!r}")


def checked(
    given: dict[str, Any], defaults: dict[str, Any], owner: str
) -> dict[str, Any]:
    """Return ``defaults`` updated by ``given``, names and types checked."""
    values = dict(defaults)
    for name, value in given.items():
        if name not in defaults:
            known = ", ".join(defaults)
            msg = f"{owner} has no parameter {name!r}; it has: {known}"
            raise ValueError(msg)
        values[name] = _as_type_of(defaults[name], value, name)
    return values


def _as_type_of(default: Any, value: Any, name: str) -> Any:
    kind = type(default)
    wrong = TypeError(
        f"{name} must be {kind.__name__}, got {type(value).__name__} {value!r}"
    )
    if kind is bool or kind is str:
        if not isinstance(value, kind):
            raise wrong
        return value
    if isinstance(value, (bool, str)):
        raise wrong
    try:
        number = kind(value)
    except (TypeError, ValueError):
        raise wrong from None
    if kind is int:
        if number != value:
            raise wrong
        if number < 0:
            msg = f"{name} must be an integer >= 0, got {value!r}"
            raise ValueError(msg)
    return number


def of_pairs(pairs: Iterable[str], wanted: str) -> dict[str, Any]:
    """Return what ``name=value`` pairs say; a value is JSON if it can be, else text.

    ``wanted`` opens the message about one that is no pair: what must look like what.
    """
    parameters: dict[str, Any] = {}
    for pair in pairs:
        name, separator, text = pair.partition("=")
        if not separator:
            msg = f"{wanted}, got {pair!r}"
            raise ValueError(msg)
        try:
            parameters[name] = json.loads(text)
        except json.JSONDecodeError:
            parameters[name] = text
    return parameters
