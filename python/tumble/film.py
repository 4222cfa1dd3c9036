"""Films of a run: pictures on all processor cores, streamed in order into an MP4 file.

Encoded as H.264, yuv420p, BT.709, which every player and browser shows. ffmpeg (from imageio-ffmpeg) is started here
rather than by imageio-ffmpeg's own writer, because that one loses what ffmpeg says when it fails and does not see a
disk that is full at the end.
"""

import contextlib
import errno
import multiprocessing
import os
import signal
import subprocess
import sys
import tempfile
import types
from collections import deque
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import IO

import numpy as np

from tumble._engine import ExportError
from tumble.arguments import whole
from tumble.folder import reason, writing
from tumble.pictures import Picture, Studio, render
from tumble.pictures.drawn import Thing
from tumble.pictures.framing import Camera
from tumble.pictures.things import Recording

QUALITY = 18
"""Constant rate factor of the encoder; 18 cannot be told from the original."""

SAMPLES = 4
"""Samples per pixel; in motion, fewer than those of a still do."""

PLAYED = (10.0, 60.0)
"""Frame rates [1/s] at which a film plays as fast as the run."""

WATCHED = 24.0
"""The rate of all others: slow motion, or time lapse."""

AHEAD = 2
"""Pictures in the making or waiting, per process."""


def film(
    run: Recording,
    path: str | os.PathLike[str],
    renderer: str = "auto",
    every: int = 1,
    size: tuple[int, int] | None = None,
    progress: Callable[[int, int], None] | None = None,
    processes: int | None = None,
    samples: int = SAMPLES,
    camera: str | None = None,
) -> Path:
    """Writes the film of a run at `rate(run)`; with `every` = n of each n-th frame, as fast. `camera`, FILE or FILE:PRIM, is
    one of a USD file, which may move, instead of the scene's.

    Odd sizes grow by a pixel, because of yuv420p. `progress(done, total)` is called after each picture. The file
    appears when it is complete. `samples` per pixel are what mitsuba takes. Raises ExportError.
    """
    every = whole(every, "every", 1, ExportError)
    studio = Studio(run, renderer, size, samples, camera)
    width, height = (n + n % 2 for n in studio.camera.size)
    if (width, height) != studio.camera.size:
        studio = Studio(run, studio.renderer, (width, height), samples, camera)
    frames = range(0, run.n_frames, every)
    processes = None if processes is None else whole(processes, "processes", 1, ExportError)
    pace = rate(run) / every
    goal = Path(path)
    unfinished = goal.with_name(f".{goal.name}.part")
    try:
        with writing(goal):
            goal.parent.mkdir(parents=True, exist_ok=True)
        drawn = contextlib.closing(_pictures(studio, frames, processes or _cores()))
        with _encoder(unfinished, goal, (width, height), pace) as sink, drawn as pictures:
            for done, image in enumerate(pictures, start=1):
                sink.write(np.ascontiguousarray(image).data)
                if progress is not None:
                    progress(done, len(frames))
        with writing(goal):
            unfinished.replace(goal)
    finally:
        with contextlib.suppress(OSError):
            unfinished.unlink(missing_ok=True)
    return goal


def rate(run: Recording) -> float:
    """Frames a second of the film of a run: as many as the scene has, if that can be watched."""
    fps = float(run.scene.get("time", {}).get("fps", WATCHED))
    return fps if PLAYED[0] <= fps <= PLAYED[1] else WATCHED


def _cores() -> int:
    """Processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _pictures(studio: Studio, frames: range, processes: int) -> Generator[Picture, None, None]:
    """The pictures in order; at most a few of them exist at a time."""
    processes = min(processes, len(frames))
    how = studio.samples, studio.stage.night
    if processes <= 1:
        yield from (render(studio.renderer, studio.things(i), studio.view(i).unit(), *how) for i in frames)
        return
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(processes, mp_context=context, initializer=_worker, initargs=(studio.renderer,))
    waiting: deque[Future[Picture]] = deque()
    try:
        for i in frames:
            if len(waiting) >= AHEAD * processes:
                yield waiting.popleft().result()
            things, camera = studio.things(i), studio.view(i).unit()
            with no_main():
                waiting.append(pool.submit(_draw, studio.renderer, things, camera, *how))
        while waiting:
            yield waiting.popleft().result()
    except BrokenProcessPool as error:
        raise ExportError(f"a process that draws with {studio.renderer} died: out of memory?") from error
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _draw(renderer: str, things: list[Thing], camera: Camera, samples: int, night: bool) -> Picture:
    return render(renderer, things, camera, samples, night)


def _worker(renderer: str) -> None:
    """Makes a process use a single core, as there is one for each, and leaves Ctrl-C to the main process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if renderer.startswith("mitsuba"):
        import drjit

        drjit.set_thread_count(1)


@contextlib.contextmanager
def no_main() -> Iterator[None]:
    """Hides the main module while processes start: they need only this one, and a script without a guard
    (`if __name__ == "__main__"`) would start them again and again."""
    main = sys.modules["__main__"]
    sys.modules["__main__"] = types.ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main


@contextlib.contextmanager
def _encoder(path: Path, goal: Path, size: tuple[int, int], rate: float) -> Iterator[IO[bytes]]:
    """ffmpeg, writing to `path` what is written to it, rgb24; `goal` is what the file will be. Raises ExportError with
    ffmpeg's own words."""
    import imageio_ffmpeg

    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-hide_banner", "-loglevel", "error", "-y"]
    command += ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{size[0]}x{size[1]}", "-r", f"{rate:.9g}", "-i", "-"]
    command += ["-an", "-c:v", "libx264", "-preset", "medium", "-crf", str(QUALITY)]
    color = "setparams=colorspace=bt709:color_primaries=bt709:color_trc=bt709"
    command += ["-vf", f"scale=out_color_matrix=bt709:out_range=tv,format=yuv420p,{color}"]
    command += ["-movflags", "+faststart", "-f", "mp4", str(path)]
    with tempfile.TemporaryFile() as words:
        process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=words)
        assert process.stdin is not None
        complete = False
        try:
            yield process.stdin
            process.stdin.close()
            complete = True
        except BrokenPipeError:
            pass  # ffmpeg is gone; below it says why.
        except BaseException:
            process.kill()
            process.wait()
            with contextlib.suppress(OSError):
                process.stdin.close()
            raise
        code = process.wait()
        with contextlib.suppress(OSError):
            process.stdin.close()
        if code != 0 or not complete:
            words.seek(0)
            said = words.read().decode(errors="replace").strip().splitlines()
            if any(os.strerror(errno.ENOSPC) in line for line in said):
                raise ExportError(f"{goal}: {reason(OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)))}")
            raise ExportError(f"{goal}: ffmpeg failed: {said[-1] if said else f'exit code {code}'}")
