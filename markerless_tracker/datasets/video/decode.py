"""Decoding the images of several cameras in parallel, with a short queue per camera."""

from collections import deque
from collections.abc import Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack

from markerless_tracker.datasets.video.images import ImageStream
from markerless_tracker.errors import ImageError
from markerless_tracker.imaging import Image, scale_image

# Images decoded in advance per camera; each takes 6 MB at 1080p.
PREFETCH = 3


def read_together(
    streams: Mapping[str, ImageStream],
    sizes_px: Mapping[str, tuple[int, int]],
    *,
    start: int,
    every: int,
) -> Iterator[tuple[int, dict[str, Image | None]]]:
    """Yield (index, camera -> image scaled to its size) for index = start, start + every, ...

    The last item yielded is the first in which a camera has no image left (None). Threads decode in
    advance; they end with the iterator, which also closes the streams.

    Raises:
        ImageError: an image's size differs from the first of its stream.
        DatasetError: an image file cannot be read.
    """
    with ExitStack() as cleanup:
        pending: dict[str, deque[Future[Image | None]]] = {name: deque() for name in streams}
        workers = {}
        for name, stream in streams.items():
            cleanup.callback(stream.close)
            # A single worker per camera keeps its reads in order.
            worker = workers[name] = ThreadPoolExecutor(1, thread_name_prefix=f"decode-{name}")
            cleanup.callback(worker.shutdown, wait=True, cancel_futures=True)
            pending[name].append(worker.submit(_next, stream, sizes_px[name], start))
            for _ in range(PREFETCH - 1):
                pending[name].append(worker.submit(_next, stream, sizes_px[name], every - 1))
        index = start
        while True:
            images = {}
            for name, stream in streams.items():
                images[name] = pending[name].popleft().result()
                pending[name].append(workers[name].submit(_next, stream, sizes_px[name], every - 1))
            yield index, images
            if any(image is None for image in images.values()):
                return
            index += every


def _next(stream: ImageStream, size_px: tuple[int, int], skip: int) -> Image | None:
    for _ in range(skip):
        if not stream.skip():
            return None
    image = stream.read()
    if image is None:
        return None
    if (image.shape[1], image.shape[0]) != stream.size_px:
        raise ImageError(
            f"{stream.path}: an image of {image.shape[1]}x{image.shape[0]} px, "
            f"expected {stream.size_px[0]}x{stream.size_px[1]} px as its first"
        )
    return scale_image(image, size_px)
