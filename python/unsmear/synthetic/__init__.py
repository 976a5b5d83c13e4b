"""Image sequences with exact truth: flow, velocity, visibility, sharp frames.

A `Scene` is a stack of textures (`scene`), each moved by an affine motion given as a
function of time (`motion`); a sequence is that scene seen at whole times, and exposed
around them (`sequence`). A `World` (`ray_caster`) holds solid bodies (`solids`,
`terrain`) with patterns (`surface`), each with a pose as a function of time (`pose`),
lit, shadowed and seen by a moving camera; nine of them recreate in kind the scenes of
the founding work (`thesis_scenes`). `blur_cases` are single pictures blurred by known
motions, `exposure_series` several exposures of one scene, to judge deblurring by.
Because motions are functions of time, flow is exact and a blurred frame is a true
integral over its exposure.
"""

from __future__ import annotations

from unsmear.synthetic.blur_cases import BLUR_CASES, BlurCase, blur_case, blur_clip
from unsmear.synthetic.exposure_series import ExposureSeries, exposure_series
from unsmear.synthetic.lighting import Light, Sky
from unsmear.synthetic.motion import (
    Motion,
    flowing,
    rotating,
    shaking,
    translating,
    zooming,
)
from unsmear.synthetic.pose import looking, placed, turned
from unsmear.synthetic.ray_caster import Body, Camera, World
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
from unsmear.synthetic.solids import Box, Disc, Rectangle, Sphere
from unsmear.synthetic.surface import Surface
from unsmear.synthetic.terrain import Terrain
from unsmear.synthetic.texture import checkers, plane_wave, texture
from unsmear.synthetic.thesis_scenes import THESIS_SCENES, sphere, thesis_scene

__all__ = [
    "BLUR_CASES",
    "THESIS_SCENES",
    "BlurCase",
    "Body",
    "Box",
    "Camera",
    "Disc",
    "ExposureSeries",
    "Layer",
    "Light",
    "Motion",
    "Rectangle",
    "Scene",
    "Sequence",
    "Sky",
    "Sphere",
    "Surface",
    "Terrain",
    "World",
    "blur_case",
    "blur_clip",
    "checkers",
    "exposure_series",
    "flowing",
    "layers",
    "looking",
    "placed",
    "plane_wave",
    "record",
    "rotating",
    "rotation",
    "shake",
    "shaking",
    "sphere",
    "texture",
    "thesis_scene",
    "translating",
    "translation",
    "turned",
    "zoom",
    "zooming",
]
