"""A link between this network namespace and another one that loses a share of the frames.

    forward.py PID LOSS        PID: of a process in the other namespace

Makes the interface link0 in both, says `ready`, and forwards until SIGTERM; then says what passed.
Must be root of the user namespace that owns both.
"""

import ctypes
import fcntl
import os
import random
import select
import signal
import struct
import sys

TUNSETIFF, IFF_TAP, IFF_NO_PI, CLONE_NEWNET = 0x400454CA, 0x0002, 0x1000, 0x40000000


def open_tap() -> int:
    """An interface link0 in the namespace that this thread is in."""
    fd = os.open("/dev/net/tun", os.O_RDWR)
    fcntl.ioctl(fd, TUNSETIFF, struct.pack("16sH22x", b"link0", IFF_TAP | IFF_NO_PI))
    return fd


def enter(pid: int) -> None:
    """Enter the network namespace of a process."""
    libc = ctypes.CDLL(None, use_errno=True)
    fd = os.open(f"/proc/{pid}/ns/net", os.O_RDONLY)
    if libc.setns(fd, CLONE_NEWNET):
        raise OSError(ctypes.get_errno(), "setns")


def main(pid: int, loss: float) -> None:
    """Forward until SIGTERM."""
    here = open_tap()
    enter(pid)
    there = open_tap()
    stop: list[int] = []
    signal.signal(signal.SIGTERM, lambda number, _: stop.append(number))
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    print("ready", flush=True)
    draw = random.Random(5)
    frames = dropped = size = 0
    while not stop:
        for fd in select.select([here, there], [], [], 0.5)[0]:
            try:
                frame = os.read(fd, 65536)
                frames += 1
                size += len(frame)
                if draw.random() < loss:
                    dropped += 1
                else:
                    os.write(there if fd == here else here, frame)
            except OSError:
                continue  # An interface is not up yet.
    print(f"frames={frames} dropped={dropped} bytes={size}", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]), float(sys.argv[2]))
