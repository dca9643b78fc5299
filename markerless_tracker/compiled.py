"""How kernels are compiled."""

from collections.abc import Callable
from typing import Any

from numba import njit

Decorator = Callable[[Callable[..., Any]], Any]

kernel: Decorator = njit(cache=True, nogil=True, error_model="numpy", _nrt=False)
"""For functions that make no array and return none.

Their arrays live as long as the caller's. Without the runtime that counts references to arrays a
view-evaluation takes a fifth less time, since every call hands on some dozens of them. Code that
would need it does not compile. The option is numba's own (`_nrt`), there since before 0.58.
"""
inlined: Decorator = njit(cache=True, nogil=True, error_model="numpy", inline="always")
"""For small functions that become part of the kernel that calls them; may return arrays."""
