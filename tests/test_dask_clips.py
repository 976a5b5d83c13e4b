"""Clips over a cluster: the same bytes as alone, whatever dies; nothing left over."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import unsmear
from unsmear import synthetic
from unsmear.cli import main

distributed = pytest.importorskip("distributed", reason="dask.distributed is not here")
import dask  # noqa: E402
import unsmear.dask  # noqa: E402
from unsmear.streaming.part_folder import _locked  # noqa: E402

COUNT = 8
SHAPE = (40, 56)
GIVEN: dict[str, Any] = {
    "method": "wiener",
    "exposure": 0.8,
    "noise": 1.0,
    "flow": np.full((*SHAPE, 2), (4, 2), np.float32),
}
PATIENCE = 120.0
"""Seconds after which what does not come will not."""


def folder_of_clips(folder: Path, names: tuple[str, ...], count: int = COUNT) -> Path:
    folder.mkdir()
    for seed, name in enumerate(names):
        texture = synthetic.texture((SHAPE[0], SHAPE[1] + 4 * count), seed=seed)
        shifts = [texture[:, 4 * index :][:, : SHAPE[1]] for index in range(count)]
        frames = np.stack(shifts)
        rise = frames - frames.min()
        unsmear.write_frames(folder / name, np.uint8(rise * (255 / rise.max())))
    return folder


def bytes_of(folder: Path) -> dict[str, bytes]:
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


@pytest.fixture(scope="module")
def client() -> Iterator[Any]:
    """A cluster of two processes on this machine."""
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as connected,
    ):
        yield connected


def doom(client: Any, count: int) -> set[int]:
    """Make workers kill themselves at their third frame, and return their numbers."""

    def die_at_the_third_frame() -> int:
        from unsmear.streaming.part_folder import PartFolder

        add = PartFolder.add

        def add_and_die(part: Any, *frame: Any) -> None:
            add(part, *frame)
            if part.done == 3:
                os.kill(os.getpid(), signal.SIGKILL)

        PartFolder.add = add_and_die  # type: ignore[method-assign]
        return os.getpid()

    client.wait_for_workers(2, timeout=PATIENCE)
    chosen = list(client.scheduler_info()["workers"])[:count]
    return set(client.run(die_at_the_third_frame, workers=chosen).values())


def test_a_killed_worker_loses_nothing(tmp_path: Path, client: Any) -> None:
    names = ("a.tif", "b.tif", "c.tif", "d.tif")
    clips = folder_of_clips(tmp_path / "clips", names)
    (tmp_path / "alone").mkdir()
    (tmp_path / "out").mkdir()
    for name in names:
        unsmear.deblur_clip(clips / name, tmp_path / "alone" / name, **GIVEN)

    doomed = doom(client, 1)
    shares: dict[int, float] = {}
    outcomes = list(
        unsmear.dask.deblur_clips(
            [(str(clips / name), str(tmp_path / "out" / name)) for name in names],
            scheduler=client,
            progress=shares.__setitem__,
            **GIVEN,
        )
    )
    assert [outcome.error for outcome in outcomes] == [None] * len(names)
    assert sorted(outcome.number for outcome in outcomes) == [0, 1, 2, 3]
    taken_up = [outcome.result.taken_up_at for outcome in outcomes]
    assert sorted(taken_up) == [0, 0, 0, 3], "taken up where the dead one left it"
    assert bytes_of(tmp_path / "out") == bytes_of(tmp_path / "alone")
    assert not doomed & set(client.run(os.getpid).values()), "it was killed indeed"
    assert shares and max(shares.values()) <= 1


@pytest.mark.parametrize("resume", [False, True])
def test_a_clip_that_kills_its_workers_is_given_up(
    tmp_path: Path, client: Any, monkeypatch: pytest.MonkeyPatch, resume: bool
) -> None:
    clips = folder_of_clips(tmp_path / "clips", ("a.tif",))
    monkeypatch.setattr(client.cluster.scheduler, "allowed_failures", 0)
    doom(client, 2)
    (outcome,) = unsmear.dask.deblur_clips(
        [(str(clips / "a.tif"), str(tmp_path / "a.tif"))],
        scheduler=client,
        resume=resume,
        **GIVEN,
    )
    assert outcome.result is None
    assert (
        outcome.error == "workers died over it, 1 in all; what they logged may tell why"
    )
    left = sorted(path.name for path in tmp_path.iterdir())
    assert left == (["a.tif.part", "clips"] if resume else ["clips"])
    # The other one would die of the next test's clip.
    client.restart(timeout=PATIENCE)


def test_one_bad_clip_spoils_no_other(tmp_path: Path, client: Any) -> None:
    clips = folder_of_clips(tmp_path / "clips", ("a.tif", "b.tif"))
    (clips / "b.tif").write_bytes(b"")
    jobs = [(str(clips / name), str(tmp_path / name)) for name in ("a.tif", "b.tif")]
    outcomes = {
        outcome.number: outcome
        for outcome in unsmear.dask.deblur_clips(jobs, scheduler=client, **GIVEN)
    }
    assert outcomes[0].error is None and outcomes[0].result.count == COUNT
    assert outcomes[1].result is None and "the file is empty" in outcomes[1].error
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.tif", "clips"]


def test_a_task_waits_for_a_predecessor_that_is_still_ending(
    tmp_path: Path, client: Any
) -> None:
    pytest.importorskip("fcntl")
    clips = folder_of_clips(tmp_path / "clips", ("a.tif",))
    part = tmp_path / "a.tif.part"
    part.mkdir()
    with _locked(part):
        outcomes = unsmear.dask.deblur_clips(
            [(str(clips / "a.tif"), str(tmp_path / "a.tif"))],
            scheduler=client,
            progress=lambda _, share: told.append(share),
            **GIVEN,
        )
        told: list[float] = []
        made: list[Any] = []
        waiting = threading.Thread(target=lambda: made.extend(outcomes))
        waiting.start()
        # Frames are checked without a word in between but the first.
        wait_for(lambda: len(told) > 2)
        assert not made and max(told) == 0
    waiting.join(PATIENCE)
    assert made[0].error is None and made[0].result.taken_up_at == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.tif", "clips"]


@pytest.mark.parametrize("resume", [False, True])
def test_an_unfinished_job_is_gone_on_with_only_on_request(
    tmp_path: Path, client: Any, resume: bool
) -> None:
    clips = folder_of_clips(tmp_path / "clips", ("a.tif",))
    job = (str(clips / "a.tif"), str(tmp_path / "a.tif"))

    def stop(share: float) -> None:
        if share >= 4 / COUNT:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        unsmear.deblur_clip(*job, resume=True, progress=stop, **GIVEN)
    (outcome,) = unsmear.dask.deblur_clips(
        [job], scheduler=client, resume=resume, **GIVEN
    )
    assert outcome.error is None
    assert outcome.result.taken_up_at == (4 if resume else 0)


def test_workers_share_the_processors(client: Any) -> None:
    def threads() -> int:
        from unsmear.dask.cores import share_cores

        share_cores()
        return unsmear.get_num_threads()

    assert set(client.run(threads).values()) == {1}
    before = unsmear.get_num_threads()
    unsmear.dask.cores.share_cores()
    assert unsmear.get_num_threads() == before, "nothing changes beside a cluster"


def test_arrays_over_processes(client: Any) -> None:
    import dask.array as da

    frames = np.random.default_rng(0).random((4, *SHAPE))
    stack = da.from_array(frames, chunks=(2, *SHAPE))
    lazy = unsmear.dask.deblur(stack, GIVEN["flow"], method="wiener", noise=0.01)
    made = lazy.frames.compute()
    for before, after in zip(frames, made, strict=True):
        alone = unsmear.deblur(before, GIVEN["flow"], method="wiener", noise=0.01)
        np.testing.assert_array_equal(after, alone.image)


def wait_for(what: Any) -> None:
    end = time.monotonic() + PATIENCE
    while not what():
        assert time.monotonic() < end, "it does not come"
        time.sleep(0.02)


@pytest.fixture
def slow(client: Any) -> Iterator[None]:
    """Workers that take a fifth of a second for every frame."""

    def slow_down() -> None:
        import time

        from unsmear.streaming.part_folder import PartFolder

        add = PartFolder.add

        def add_slowly(part: Any, *frame: Any) -> None:
            add(part, *frame)
            time.sleep(0.2)

        add_slowly.quick = add  # type: ignore[attr-defined]
        PartFolder.add = add_slowly  # type: ignore[method-assign]

    def speed_up() -> None:
        from unsmear.streaming.part_folder import PartFolder

        add = PartFolder.add
        PartFolder.add = getattr(add, "quick", add)  # type: ignore[method-assign]

    client.wait_for_workers(2, timeout=PATIENCE)
    client.run(slow_down)
    yield
    client.run(speed_up)


@pytest.mark.skipif(sys.platform == "win32", reason="signals are those of POSIX")
@pytest.mark.parametrize("resume", [True, False])
def test_an_interrupted_run_leaves_what_can_be_taken_up(
    tmp_path: Path, client: Any, slow: None, capsys: Any, resume: bool
) -> None:
    """Ctrl-C at the client of a cluster that goes on."""
    clips = folder_of_clips(tmp_path / "clips", ("a.tif", "b.tif", "c.tif"), 100)
    unsmear.write_flow(tmp_path / "flow.flo", GIVEN["flow"])
    out = tmp_path / "out"
    options = ["--flow", str(tmp_path / "flow.flo"), "--method", "wiener"]
    options += ["--noise", "1", "--exposure", "0.8"]
    command = ["deblur", str(clips / "*.tif"), "--each", "-o", str(out), *options]
    address = client.scheduler.address
    run = subprocess.Popen(
        [sys.executable, "-m", "unsmear", *command, "--scheduler", address]
        + (["--resume"] if resume else []),
        stderr=subprocess.PIPE,
        text=True,
    )
    wait_for(lambda: len(list(out.glob("*.part/piece_*.json"))) > 3)
    run.send_signal(signal.SIGINT)
    _, said = run.communicate(timeout=PATIENCE)
    assert run.returncode == 130 and "unsmear: interrupted" in said
    if not resume:
        # Tasks clear up behind themselves after the frame they are at.
        wait_for(lambda: not list(out.iterdir()))
        return
    (first, *_) = left = sorted(path.name for path in out.iterdir())
    assert all(name.endswith(".tif.part") for name in left)
    name = first.removesuffix(".part")

    def take_up() -> int:
        command = ["deblur", str(clips / name), "-o", str(out / name), *options]
        return main([*command, "--resume", "--json"])

    wait_for(lambda: take_up() == 0)  # a task may still be at the frame it was
    assert json.loads(capsys.readouterr().out)["taken up at frame"] > 0
    unsmear.deblur_clip(clips / name, tmp_path / "alone.tif", **GIVEN)
    assert (out / name).read_bytes() == (tmp_path / "alone.tif").read_bytes()


def test_the_command_line_starts_a_cluster_of_its_own(tmp_path: Path) -> None:
    clips = folder_of_clips(tmp_path / "clips", ("a.tif", "b.tif", "c.gif"), 3)
    (clips / "b.tif").write_bytes(b"no picture")
    unsmear.write_flow(tmp_path / "flow.flo", GIVEN["flow"])
    command = ["deblur", "clips/*", "--each", "-o", "out", "--flow", "flow.flo"]
    command += ["--method", "wiener", "--scheduler", "local", "--json"]
    done = subprocess.run(
        [sys.executable, "-m", "unsmear", *command],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1, done.stderr
    assert "unsmear: clips/b.tif: cannot read" in done.stderr
    assert "Traceback" not in done.stderr
    told = json.loads(done.stdout)
    assert told["clips"] == 3 and told["failed"] == 1
    assert [one["error"] is None for one in told["results"]] == [True, False, True]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        "a.tif",
        "c.tif",
    ]


def test_a_scheduler_that_does_not_answer(tmp_path: Path, capsys: Any) -> None:
    clips = folder_of_clips(tmp_path / "clips", ("a.tif",), 2)
    command = ["deblur", str(clips / "a.tif"), "-o", str(tmp_path / "out.tif")]
    with dask.config.set({"distributed.comm.timeouts.connect": "0.3s"}):
        assert main([*command, "--scheduler", "tcp://127.0.0.1:9"]) == 1
    assert "127.0.0.1:9" in capsys.readouterr().err
    assert not (tmp_path / "out.tif").exists()
