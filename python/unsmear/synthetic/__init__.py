"""Image sequences with exact truth: flow, velocity, visibility, sharp frames.

A scene is a stack of textures (`scene`), each moved by an affine motion given as a
function of time (`motion`); a sequence is that scene seen at whole times, and exposed
around them (`sequence`). Because motions are functions of time, flow is exact and a
blurred frame is a true integral over its exposure.
"""

from __future__ import annotations

from unsmear.synthetic.motion import Motion, rotating, shaking, translating, zooming
from unsmear.synthetic.scene import Layer, Scene
from unsmear.synthetic.sequence import (
    Sequence,
    layers,
    record,
    rotation,
    shake,
    translation,
    zoom,
)
from unsmear.synthetic.texture import plane_wave, texture

__all__ = [
    "Layer",
    "Motion",
    "Scene",
    "Sequence",
    "layers",
    "plane_wave",
    "record",
    "rotating",
    "rotation",
    "shake",
    "shaking",
    "texture",
    "translating",
    "translation",
    "zoom",
    "zooming",
]
