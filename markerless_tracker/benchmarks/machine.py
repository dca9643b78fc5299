"""The machine on which a figure was measured."""

import os
import platform
from pathlib import Path
from typing import Any

from markerless_tracker.libraries import usable_cores

CPUINFO = Path("/proc/cpuinfo")


def machine() -> dict[str, Any]:
    """Processor, cores this process may use, memory, system and load, as plain values.

    `load` is the mean of the last minute. Times measured under a load well above the number of
    this process's threads are too long, above all those of parallel parts.
    """
    return {
        "cpu": processor(),
        "cores": usable_cores(),
        "memory_gib": _memory_gib(),
        "system": f"{platform.system()} {platform.release()} {platform.machine()}",
        "load": _load(),
    }


def processor(cpuinfo: Path = CPUINFO) -> str:
    """The processor's name, or its architecture if the system does not state the name."""
    try:
        for line in cpuinfo.read_text(encoding="utf-8", errors="replace").splitlines():
            key, _, value = line.partition(":")
            if key.strip() == "model name" and value.strip():
                return value.strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


def _memory_gib() -> float | None:
    try:
        total = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):
        return None
    return round(total / 2**30, 1)


def _load() -> float | None:
    try:
        return round(os.getloadavg()[0], 2)
    except (AttributeError, OSError):
        return None
