"""Stacks and pictures larger than memory, and clips over a cluster.

Needs dask: ``pip install 'unsmear[dask]'``. Functions have the names of those for
arrays in memory, take `dask.array` and return it, computed when it is asked for.

| module     | task                                                                |
|------------|---------------------------------------------------------------------|
| parts      | arguments checked, parts of arrays as single blocks, and back       |
| cores      | how many threads a task may use                                     |
| flow       | motion of every frame of a stack, chunk by chunk in time            |
| stacks     | every frame of a stack restored by itself                           |
| sequences  | the chain of `unsmear.deblur_sequence`, with the frames it looks at |
| halos      | how much of its surroundings a tile needs                           |
| tiles      | one large picture, tile by tile with the exact halo                 |
| clips      | clips from file to file, each one task of `dask.distributed`        |
"""

from __future__ import annotations

try:
    import dask.array  # noqa: F401 -- asked for here, so that one message tells all
except ImportError as error:
    raise ImportError("unsmear.dask needs dask: pip install 'unsmear[dask]'") from error

from unsmear.dask.clips import ClipOutcome, deblur_clips
from unsmear.dask.flow import FlowStack, optical_flow
from unsmear.dask.sequences import LazySequence, deblur_sequence
from unsmear.dask.stacks import LazyRestoration, deblur
from unsmear.dask.tiles import blur, wiener

__all__ = [
    "ClipOutcome",
    "FlowStack",
    "LazyRestoration",
    "LazySequence",
    "blur",
    "deblur",
    "deblur_clips",
    "deblur_sequence",
    "optical_flow",
    "wiener",
]
