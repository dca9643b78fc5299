"""How kernels are compiled, and when what numba stored of them is out of date.

numba looks at the date of a kernel's own file only. A kernel that calls one in another file would
keep the old one compiled into it after an edit there. So the names of the stored files hold a
digest of all sources that they are compiled from, of numba's version and of LLVM's level: two
environments that share the package's folder would replace each other's. `make clean` removes old
ones.
"""

import hashlib
import inspect
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any
from weakref import WeakSet

from numba import __version__ as numba_version
from numba import njit
from numba.core import config, event
from numba.core.caching import CompileResultCacheImpl, FunctionCache

from markerless_tracker.libraries import collect_new_objects

PACKAGE = Path(__file__).resolve().parent
_COMPILE = "numba:compile"
_MOST_OPTIMISED = 2
"""LLVM's level. numba's default of 3 takes longer to compile, and sampled edges and outlines take a
fifth longer in its code. A lower level asked for by `NUMBA_OPT` stays."""
_IMPORT = r"^\s*from {}\.([\w.]+) import (?:(\w.*)|\(([^)]*)\))"

Decorator = Callable[[Callable[..., Any]], Any]
Progress = Callable[[str, int, int], None]
"""Receives the name of a kernel that is being compiled, the number of kernels compiled so far, and
the most that there can be."""

_dispatchers: "WeakSet[Any]" = WeakSet()


def compiled(**options: Any) -> Decorator:
    """A decorator as `numba.njit`, without the interpreter's lock, stored on disk.

    Args:
        options: further options of `numba.njit`.
    """

    def decorate(function: Callable[..., Any]) -> Any:
        # Nothing calls kernels from C; their wrappers for it would take a seventh of the time.
        dispatcher = njit(nogil=True, no_cfunc_wrapper=True, **options)(function)
        dispatcher._cache = _Cache(function)
        _limit_optimisation(dispatcher._compiler)
        _dispatchers.add(dispatcher)
        return dispatcher

    return decorate


def _limit_optimisation(compiler: Any) -> None:
    """Make the compiler of one dispatcher use at most `_MOST_OPTIMISED`.

    numba has one level for a process. It is changed only while this compiler works, which holds
    numba's lock, so kernels of other packages keep theirs.
    """
    compile_as_configured = compiler.compile

    def compile_limited(*args: Any) -> Any:
        configured = config.OPT
        config.OPT = type(configured)(min(configured, _MOST_OPTIMISED))
        try:
            return compile_as_configured(*args)
        finally:
            config.OPT = configured

    compiler.compile = compile_limited


kernel: Decorator = compiled(error_model="numpy", _nrt=False)
"""For functions that make no array and return none.

Their arrays live as long as the caller's. Without the runtime that counts references to arrays a
view-evaluation takes a fifth less time, since every call hands on some dozens of them. Code that
would need it does not compile. The option is numba's own (`_nrt`), there since before 0.58.
"""
inlined: Decorator = compiled(error_model="numpy", inline="always")
"""For small functions that become part of the kernel that calls them; may return arrays."""


@cache
def source_digest(file: Path, package: Path = PACKAGE) -> str:
    """Digest of what compiles the kernels of a file and from what, part of stored files' names."""
    made_by = f"{numba_version} {min(config.OPT, _MOST_OPTIMISED)}"
    parts = [made_by.encode(), *(_text(s).encode() for s in kernel_sources(file, package))]
    return hashlib.sha256(b"\0".join(parts)).hexdigest()[:12]


def kernel_sources(file: Path, package: Path = PACKAGE) -> list[Path]:
    """What the kernels of a file are compiled from: that file and others of the package; sorted.

    Others are those that it imports kernels, constants (upper case) or named tuples from, and what
    these import in the same way.

    Args:
        file: a module of the package.
        package: the package's folder, named as the package.
    """
    found = {file}
    todo = [file]
    while todo:
        for source, names in _imported(package, todo.pop()):
            if source not in found and _compiles(source, names):
                found.add(source)
                todo.append(source)
    return sorted(found)


# A file is read and searched once: many kernels are compiled from the same ones.


@cache
def _text(source: Path) -> str:
    return source.read_text(encoding="utf-8")


@cache
def _imported(package: Path, file: Path) -> tuple[tuple[Path, tuple[str, ...]], ...]:
    """Modules of the package that a module imports from, and the names it takes."""
    imported: list[tuple[Path, tuple[str, ...]]] = []
    pattern = _IMPORT.format(package.name)
    for module, one, several in re.findall(pattern, _text(file), re.MULTILINE):
        above = package.joinpath(*module.split("."))
        names = tuple(re.findall(r"\w+", one or several))
        candidates = [(above.with_suffix(".py"), names)]
        candidates += [(above / f"{name}.py", ()) for name in names]
        imported += [candidate for candidate in candidates if candidate[0].is_file()]
    return tuple(imported)


@cache
def _compiles(source: Path, names: tuple[str, ...]) -> bool:
    """Whether kernels that import these names from a module depend on its text."""
    text = _text(source)
    return "compiled import" in text or any(
        name.isupper() or f"class {name}(NamedTuple)" in text for name in names
    )


class Compilation(event.Listener):  # type: ignore[misc]
    """Counts what is compiled; nothing that is stored on disk already counts."""

    def __init__(self, report: Progress) -> None:
        self._here = self._elsewhere = 0
        self._report = report

    @property
    def done(self) -> int:
        """Kernels compiled so far, here and in other processes."""
        return self._here + self._elsewhere

    def on_start(self, event: Any) -> None:
        """Called by numba."""
        self._tell(event)

    def on_end(self, event: Any) -> None:
        """Called by numba."""
        if event.data["dispatcher"] in _dispatchers:
            self._here += 1
            self._tell(event)

    def elsewhere(self, name: str, done: int, most: int) -> None:
        """Another process, which works for this one, has compiled so many kernels."""
        self._elsewhere = done
        self._report(name, self.done, max(most, len(_dispatchers)))

    def _tell(self, event: Any) -> None:
        dispatcher = event.data["dispatcher"]
        if dispatcher in _dispatchers:
            self._report(dispatcher.py_func.__name__, self.done, len(_dispatchers))


_compilations: list[Compilation] = []


@contextmanager
def compilation(report: Progress) -> Iterator[Compilation]:
    """Report what is compiled in this block, in any thread.

    The most that there can be are all kernels of the modules imported so far; few settings need
    all of them.
    """
    listener = Compilation(report)
    event.register(_COMPILE, listener)
    _compilations.append(listener)
    try:
        with collect_new_objects():
            yield listener
    finally:
        _compilations.remove(listener)
        event.unregister(_COMPILE, listener)


def compiled_elsewhere(name: str, done: int, most: int) -> None:
    """Tell all `compilation` blocks what another process has compiled; as `Progress`."""
    for listener in _compilations:
        listener.elsewhere(name, done, most)


class _Impl(CompileResultCacheImpl):  # type: ignore[misc]
    def __init__(self, function: Callable[..., Any]) -> None:
        self._digest = source_digest(Path(inspect.getfile(function)))
        super().__init__(function)

    def get_filename_base(self, fullname: str, abiflags: str) -> str:
        base: str = super().get_filename_base(fullname, abiflags)
        return f"{base}-{self._digest}"


class _Cache(FunctionCache):  # type: ignore[misc]
    _impl_class = _Impl
