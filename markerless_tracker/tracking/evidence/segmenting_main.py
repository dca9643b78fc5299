"""Main program of the segmenting process: images in, observations out, until its input ends.

Started as ``python -m markerless_tracker.tracking.evidence.segmenting_main FD``, where FD is the
shared memory. Standard input gives the parent's requests; standard output takes only the answers.
"""

import mmap
import sys
import time
from typing import Any, BinaryIO

from markerless_tracker.libraries import collect_for_good, keep_freed_memory, single_threaded


def main(memory_fd: int) -> int:
    """Serve until the parent ends; returns the exit status."""
    single_threaded()
    keep_freed_memory()
    from markerless_tracker.tracking.processes.child import take_output

    memory = mmap.mmap(memory_fd, 0, prot=mmap.PROT_READ)
    try:
        serve(sys.stdin.buffer, take_output(), memory)
    except (EOFError, BrokenPipeError):
        pass  # The parent has ended.
    return 0


def serve(requests: BinaryIO, answers: BinaryIO, memory: mmap.mmap) -> None:
    """Answer messages: segmentation requests, or a new rig, configuration and backgrounds.

    The answer to a request is the result of `EvidenceMaker.segment_regions` without the images, or
    the exception it raised. The answer to new backgrounds is `Ready`, once the kernels of this
    process and some of the parent's have been compiled. Each answer is sent with the CPU time of
    this process.

    Raises:
        EOFError, BrokenPipeError: the parent has ended.
    """
    # Imported while the parent starts.
    import cv2

    from markerless_tracker.compiled import compilation
    from markerless_tracker.tracking.evidence.gather import EvidenceMaker
    from markerless_tracker.tracking.evidence.segmenting import Ready, SegmentRequest
    from markerless_tracker.tracking.processes.compiling import compile_contours
    from markerless_tracker.tracking.processes.images import get
    from markerless_tracker.tracking.processes.wire import receive, send

    # OpenCV's threads wait in busy loops, which would take cores from the other processes.
    cv2.setNumThreads(1)
    maker: EvidenceMaker | None = None
    while True:
        message = receive(requests)
        answer: Any
        try:
            if not isinstance(message, SegmentRequest):
                rig, config, backgrounds = message
                maker = EvidenceMaker(rig, config, backgrounds, map)
                with compilation(lambda *_: None) as kernels:
                    maker.finish_compiling()
                    # The parent has stored some of its kernels by now.
                    compile_contours(rig, config, maker.made_up())
                collect_for_good()
                answer = Ready(kernels.done)
            elif maker is None:
                raise RuntimeError("images came before the backgrounds")
            else:
                images = {name: get(memory, place) for name, place in message.images.items()}
                seen = maker.segment_regions(images, message.stamp_ns, message.regions)
                answer = {name: view._replace(image=None) for name, view in seen.items()}
        except Exception as error:
            answer = error
        send(answers, (answer, time.process_time()))


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1])))
