"""Lazy stacks and tiles: equal to memory bit for bit; nothing computed too early."""

from __future__ import annotations

import doctest
import importlib
import subprocess
import sys
import textwrap
from typing import Any

import numpy as np
import pytest
import unsmear
from unsmear import synthetic
from unsmear.restoration.passes import reach
from unsmear.restoration.source import Source
from unsmear.sequence import restored_frames, settings_of

da = pytest.importorskip("dask.array", reason="dask is not here")
import dask  # noqa: E402
import unsmear.dask  # noqa: E402

SHAPE = (48, 64)
QUICK: dict[str, Any] = {"method": "fast", "warps": 1, "finest_warps": 1, "passes": 1}
CHAIN: dict[str, Any] = {"flow_method": "fast", "warps": 2, "passes": 1}


@pytest.fixture(autouse=True)
def in_this_thread() -> Any:
    """Errors of tasks are raised where they are asked for."""
    with dask.config.set(scheduler="synchronous"):
        yield


def clip(count: int, colour: bool = False, **options: Any) -> np.ndarray:
    made = synthetic.translation(
        synthetic.texture((150, 150), seed=4),
        (5.0, 2.0),
        shape=SHAPE,
        exposure=0.9,
        n_frames=count,
        noise=1.0,
        **({"bits": 8} | options),
    ).blurred
    return np.stack([made, made[::-1], made], axis=1) if colour else made


class Counted:
    """An array that notes what is read of it."""

    def __init__(self, array: np.ndarray) -> None:
        self._array = array
        self.shape, self.dtype, self.ndim = array.shape, array.dtype, array.ndim
        self.read: list[Any] = []

    def __getitem__(self, part: Any) -> np.ndarray:
        self.read.append(part)
        return self._array[part]


def never_read(shape: tuple[int, ...], dtype: Any, chunks: Any) -> Any:
    def fail(block: np.ndarray) -> np.ndarray:
        raise AssertionError("computed too early")

    zeros = da.zeros(shape, dtype=dtype, chunks=chunks)
    return zeros.map_blocks(fail, dtype=dtype, meta=np.empty((0,) * len(shape), dtype))


def test_shapes_types_and_chunks_are_known_before_anything_is_computed() -> None:
    stack = never_read((7, 20, 30, 3), np.uint16, (3, 8, 30, 1))
    motion = unsmear.dask.optical_flow(stack, channel_axis=3)
    assert motion.flow.chunks == ((3, 3), (20,), (30,), (2,))
    assert motion.flow.shape == (6, 20, 30, 2) and motion.flow.dtype == np.float32
    assert motion.confidence.shape == (6, 20, 30) and motion.valid.dtype == bool
    assert isinstance(motion.flow._meta, np.ndarray)
    whole = unsmear.dask.deblur_sequence(stack, channel_axis=-1)
    assert whole.frames.shape == stack.shape and whole.frames.dtype == np.uint16
    assert whole.frames.chunks == ((3, 3, 1), (20,), (30,), (3,))
    assert whole.flows.shape == (7, 20, 30, 2)
    alone = unsmear.dask.deblur(
        stack, never_read((7, 20, 30, 2), "f4", 5), channel_axis=3
    )
    assert alone.frames.shape == stack.shape and alone.frames.dtype == np.uint16
    picture = never_read((60, 90), np.float64, 32)
    flow = never_read((60, 90, 2), np.float32, 45)
    for tiled in (
        unsmear.dask.blur(picture, flow, longest=5),
        unsmear.dask.wiener(picture, flow, longest=5, noise=1.0),
    ):
        assert tiled.chunks == picture.chunks and tiled.dtype == np.float64


def keys_of_all() -> list[str]:
    stack = da.ones((5, 20, 30), chunks=2)
    flow = np.ones((20, 30, 2))
    lazy = [
        unsmear.dask.optical_flow(stack, warps=2).flow,
        unsmear.dask.deblur_sequence(stack, exposure=0.5).frames,
        unsmear.dask.deblur(stack, flow, noise=1.0).frames,
        unsmear.dask.blur(stack[0], flow),
        unsmear.dask.wiener(stack[0], flow, noise=1.0),
    ]
    return sorted(str(key) for one in lazy for key in one.__dask_graph__())


def test_keys_are_those_of_the_same_call_and_of_no_other() -> None:
    assert keys_of_all() == keys_of_all()
    stack = da.ones((5, 20, 30), chunks=2)
    flow = unsmear.dask.optical_flow
    names = {flow(stack).flow.name, flow(stack, warps=2).flow.name}
    names |= {flow(stack, method="fast").flow.name, flow(stack + 1).flow.name}
    assert len(names) == 4


@pytest.mark.parametrize(
    ("options", "needed"),
    [(QUICK, range(4, 6)), (QUICK | {"method": "steady"}, range(1, 8))],
)
def test_flow_equals_memory_and_reads_what_the_method_needs(
    options: dict[str, Any], needed: range
) -> None:
    frames = clip(9)
    counted = Counted(frames)
    source = da.from_array(counted, chunks=(1, 16, 16), name="counted", asarray=False)
    lazy = unsmear.dask.optical_flow(source, **options)
    fourth = lazy.flow[4].compute()
    # Dask looks at an empty part to learn the type.
    read = {part[0].start for part in counted.read if part[0].stop > part[0].start}
    assert read == set(needed)
    whole = unsmear.optical_flow(frames, index=4, **options)
    np.testing.assert_array_equal(fourth, whole.flow)


def test_flow_of_colour_with_its_confidence() -> None:
    frames = clip(4, colour=True)
    lazy = unsmear.dask.optical_flow(
        da.from_array(frames, chunks=(3, 1, 20, 20)), channel_axis=1, **QUICK
    )
    flow, confidence, valid = dask.compute(lazy.flow, lazy.confidence, lazy.valid)
    for index in range(3):
        whole = unsmear.optical_flow(frames, index=index, channel_axis=1, **QUICK)
        np.testing.assert_array_equal(flow[index], whole.flow)
        np.testing.assert_array_equal(confidence[index], whole.confidence)
        np.testing.assert_array_equal(valid[index], whole.valid)


def test_restored_stack_equals_memory() -> None:
    frames = clip(5)
    rng = np.random.default_rng(1)
    flow = np.float32((3.0, 1.5)) + 0.1 * rng.standard_normal((5, *SHAPE, 2), "f4")
    weights = np.linspace(0.5, 1, SHAPE[0] * SHAPE[1]).reshape(SHAPE)
    lazy = unsmear.dask.deblur(
        da.from_array(frames, chunks=(2, 16, 16)),
        da.from_array(flow, chunks=(1, -1, -1, 1)),
        acceleration=np.full((*SHAPE, 2), 0.2),
        weights=weights,
        method="fast",
        exposure=0.8,
    )
    made, reports = dask.compute(lazy.frames, lazy.reports)
    assert len(reports) == 5
    for index in (0, 3, 4):
        alone = unsmear.deblur(
            frames[index],
            flow[index],
            acceleration=np.full((*SHAPE, 2), 0.2),
            weights=weights,
            method="fast",
            exposure=0.8,
        )
        np.testing.assert_array_equal(made[index], alone.image)
        assert reports[index] == alone.report


@pytest.mark.parametrize("colour", [False, True])
def test_restored_sequence_equals_memory(colour: bool) -> None:
    frames = clip(9 if colour else 12, colour, **({"bits": None} if colour else {}))
    options = CHAIN | {
        "second_pass": False,
        "seed": 3,
        "channel_axis": 1 if colour else None,
        "joint": 3 if colour else 1,
    }
    whole = unsmear.deblur_sequence(frames, **options)
    chunks = (3 if colour else (3, 9), *frames.shape[1:-1], 20)
    lazy = unsmear.dask.deblur_sequence(da.from_array(frames, chunks=chunks), **options)
    made, flows, reports = dask.compute(lazy.frames, lazy.flows, lazy.reports)
    np.testing.assert_array_equal(made, whole.frames)
    np.testing.assert_array_equal(flows, whole.flows)
    assert reports == whole.reports
    assert made.dtype == frames.dtype and not np.array_equal(made, frames)


class Watched:
    """Frames that note which of them are asked for."""

    def __init__(self, frames: np.ndarray) -> None:
        self._frames = frames[..., np.newaxis]
        self.shape, self.dtype = self._frames.shape, frames.dtype
        self.asked: set[int] = set()

    def __getitem__(self, index: int, /) -> np.ndarray:
        self.asked.add(index)
        return self._frames[index]


@pytest.mark.parametrize(
    ("exposure", "joint", "pooled"), [("auto", 1, True), (0.9, 3, False)]
)
def test_the_window_is_what_a_frame_depends_on(
    exposure: float | str, joint: int, pooled: bool
) -> None:
    frames = Watched(clip(21))
    source = Source.read_when_needed(frames)
    frames.asked.clear()
    options = {name: value for name, value in CHAIN.items() if name != "flow_method"}
    settings = settings_of(exposure, None, "fast", options, joint, 0, source.scale)
    found = next(restored_frames(source, [10], settings, second_pass=False))
    assert (joint == 1) or "neighbours_weight" in found[2]
    halo = reach(False, joint)
    assert halo == 7 + (joint == 3) and reach(None, joint) == halo + 14
    if not pooled:
        halo -= 2  # those of the frames whose exposures would be pooled
    asked = {index for index in frames.asked if index}
    assert asked == set(range(10 - halo, 10 + halo + 1)), "all of it, no more"


def test_a_frame_beyond_the_window_is_an_error_and_no_wrong_result() -> None:
    frames = np.zeros((3, 8, 9), np.uint8)
    window = unsmear.dask.sequences.Window(frames, frames[:1], 5, (20, 8, 9))
    assert window[5].shape == (8, 9, 1) and window[0].shape == (8, 9, 1)
    for index in (4, 8):
        with pytest.raises(IndexError, match=r"frame must be in 5\.\.7, got"):
            window[index]


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (
            lambda _: unsmear.dask.optical_flow(np.zeros((3, 8, 8))),
            TypeError,
            "dask array",
        ),
        (lambda a: unsmear.dask.optical_flow(a[0]), ValueError, "channel_axis"),
        (lambda a: unsmear.dask.optical_flow(a[:1]), ValueError, "at least 2"),
        (lambda a: unsmear.dask.optical_flow(a > 1), TypeError, "dtype bool"),
        (lambda a: unsmear.dask.optical_flow(a[a[:, 0, 0] > 0]), ValueError, "nan"),
        (lambda a: unsmear.dask.optical_flow(a, method="thesis"), ValueError, "thesis"),
        (lambda a: unsmear.dask.optical_flow(a, speed=1), ValueError, "speed"),
        (lambda a: unsmear.dask.deblur_sequence(a, joint=2), ValueError, "joint"),
        (
            lambda a: unsmear.dask.deblur(a, np.zeros((8, 8, 2)), lens=1),
            TypeError,
            "lens",
        ),
        (lambda a: unsmear.dask.deblur(a, np.zeros((8, 9, 2))), ValueError, "flow"),
        (lambda a: unsmear.dask.blur(a[0], a[:2]), ValueError, "longest"),
        (lambda a: unsmear.dask.blur(a[0], np.zeros((8, 8, 3))), ValueError, "flow"),
        (lambda a: unsmear.dask.wiener(a[0], np.zeros((8, 8, 2))), ValueError, "noise"),
    ],
)
def test_wrong_arguments_are_named(call: Any, error: Any, message: str) -> None:
    with pytest.raises(error, match=message):
        call(da.ones((3, 8, 8), chunks=2))


# What is there is measured after everything is imported and warm; then the memory for
# data may grow by ROOM only, less than half of the stack.
LIMITED = """
    import resource, sys
    import dask, dask.array as da, numpy as np, unsmear, unsmear.dask

    unsmear.set_num_threads(1)
    COUNT, HEIGHT, WIDTH, ROOM = 66, 240, 320, 56 << 20
    OPTIONS = dict(method="fast", warps=1, finest_warps=1, passes=1, sweeps=3)
    WIENER = dict(method="wiener", noise=0.01)

    texture = unsmear.synthetic.texture((HEIGHT, WIDTH + 2 * COUNT), seed=1)

    def frame(index):
        one = texture[:, 2 * index :][:, :WIDTH]
        return np.stack([one, one[::-1], 2 * one], axis=-1)

    def frames(block_info=None):
        (start, stop), *_ = block_info[None]["array-location"]
        return np.stack([frame(index) for index in range(start, stop)])

    shape = (COUNT, HEIGHT, WIDTH, 3)
    stack = da.map_blocks(
        frames, chunks=((2,) * 33, *shape[1:]), dtype=float, meta=np.empty((0,) * 4)
    )
    assert stack.nbytes > 2 * ROOM, stack.nbytes
    flow = np.full((HEIGHT, WIDTH, 2), (2.0, 0.0), np.float32)
    first = unsmear.optical_flow(frames({None: {"array-location": [(0, 2)]}}), index=0,
                                 channel_axis=3, **OPTIONS)
    files = [
        np.lib.format.open_memmap(f"{sys.argv[1]}/{name}.npy", "w+", dtype, (n, *rest))
        for name, dtype, n, rest in (
            ("flow", np.float32, COUNT - 1, (HEIGHT, WIDTH, 2)),
            ("sharp", np.float64, COUNT, shape[1:3]),
        )
    ]
    used = next(
        int(line.split()[1]) << 10 for line in open("/proc/self/status")
        if line.startswith("VmData")
    )
    resource.setrlimit(resource.RLIMIT_DATA, (used + ROOM, used + ROOM))
    try:
        np.ones(shape)
    except MemoryError:
        print("the whole does not fit")
    with dask.config.set(scheduler="synchronous"):
        lazy = unsmear.dask.optical_flow(stack, channel_axis=3, **OPTIONS).flow
        sharp = unsmear.dask.deblur(stack[..., 0], flow, **WIENER).frames
        da.store([lazy, sharp], files, lock=False)
    for index in range(0, COUNT - 1, 9):
        pair = frames({None: {"array-location": [(index, index + 2)]}})
        whole = unsmear.optical_flow(pair, index=0, channel_axis=3, **OPTIONS).flow
        assert np.array_equal(files[0][index], whole, equal_nan=True), index
        alone = unsmear.deblur(pair[0, ..., 0], flow, **WIENER).image
        assert np.array_equal(files[1][index], alone), index
    assert np.nanmax(np.abs(files[0][40])) > 0.5
    print("equal")
"""


@pytest.mark.skipif(sys.platform != "linux", reason="limits of memory are Linux's")
def test_a_stack_larger_than_the_memory_there_is(tmp_path: Any) -> None:
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(LIMITED), str(tmp_path)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split("\n")[:2] == ["the whole does not fit", "equal"]


@pytest.mark.parametrize("name", ["flow", "sequences", "stacks", "tiles", "clips"])
def test_examples_run(name: str) -> None:
    module = importlib.import_module(f"unsmear.dask.{name}")
    failed, tried = doctest.testmod(module)
    assert failed == 0 < tried


def test_the_package_needs_dask_only_for_this() -> None:
    code = """
        import sys
        sys.modules["dask"] = sys.modules["distributed"] = None
        import unsmear
        try:
            import unsmear.dask
        except ImportError as error:
            print(error)
    """
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)],
        capture_output=True,
        text=True,
        check=True,
    )
    assert "pip install 'unsmear[dask]'" in done.stdout
