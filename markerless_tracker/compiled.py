"""How kernels are compiled, and when what numba stored of them is out of date.

numba looks at the date of a kernel's own file only. A kernel that calls one in another file would
keep the old one compiled into it after an edit there. So the names of the stored files hold a
digest of all sources that kernels are compiled from. `make clean` removes old ones.
"""

import hashlib
import re
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import Any

from numba import njit
from numba.core.caching import CompileResultCacheImpl, FunctionCache

PACKAGE = Path(__file__).resolve().parent
_IMPORT = r"^\s*from {}\.([\w.]+) import (?:(\w.*)|\(([^)]*)\))"

Decorator = Callable[[Callable[..., Any]], Any]


def compiled(**options: Any) -> Decorator:
    """A decorator as `numba.njit`, without the interpreter's lock, stored on disk.

    Args:
        options: further options of `numba.njit`.
    """

    def decorate(function: Callable[..., Any]) -> Any:
        dispatcher = njit(nogil=True, **options)(function)
        dispatcher._cache = _Cache(function)
        return dispatcher

    return decorate


kernel: Decorator = compiled(error_model="numpy", _nrt=False)
"""For functions that make no array and return none.

Their arrays live as long as the caller's. Without the runtime that counts references to arrays a
view-evaluation takes a fifth less time, since every call hands on some dozens of them. Code that
would need it does not compile. The option is numba's own (`_nrt`), there since before 0.58.
"""
inlined: Decorator = compiled(error_model="numpy", inline="always")
"""For small functions that become part of the kernel that calls them; may return arrays."""


def kernel_sources(package: Path) -> list[Path]:
    """Files that hold kernels, and the files of the package that these import; sorted.

    Args:
        package: its folder, named as the package.
    """
    texts = {file: file.read_text(encoding="utf-8") for file in package.rglob("*.py")}
    found = {file for file, text in texts.items() if f"from {package.name}.compiled import" in text}
    todo = list(found)
    while todo:
        for file in _imported(package, texts[todo.pop()]):
            if file in texts and file not in found:
                found.add(file)
                todo.append(file)
    return sorted(found)


@cache
def source_digest(package: Path = PACKAGE) -> str:
    """Digest of all kernel sources, part of the names of the files that numba stores."""
    sources = b"\0".join(file.read_bytes() for file in kernel_sources(package))
    return hashlib.sha256(sources).hexdigest()[:12]


def _imported(package: Path, text: str) -> Iterable[Path]:
    """Modules of the package that a text imports from; not packages, which only hand on names."""
    for module, one, several in re.findall(_IMPORT.format(package.name), text, re.MULTILINE):
        above = package.joinpath(*module.split("."))
        yield above.with_suffix(".py")
        yield from (above / f"{name}.py" for name in re.findall(r"\w+", one or several))


class _Impl(CompileResultCacheImpl):  # type: ignore[misc]
    def get_filename_base(self, fullname: str, abiflags: str) -> str:
        base: str = super().get_filename_base(fullname, abiflags)
        return f"{base}-{source_digest()}"


class _Cache(FunctionCache):  # type: ignore[misc]
    _impl_class = _Impl
