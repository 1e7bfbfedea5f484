"""How kernels are compiled: one place for the numba flags and for the on-disk cache.

Five decorators:

``inner``   a helper that other kernels call; never cached by itself.
``scalar``  the same, a few lines of arithmetic that are always a part of their caller.
``spliced`` the same, large and called in one place only.
``kernel``  an entry point that Python calls; compiled once per machine and kept on disk.
``lean_kernel``  the same, for one that makes no array.

numba stamps a cached kernel with its own file only, so an edited helper in another module would keep serving the stale
binary.  The cache directory is therefore named after a hash of every source file of the package that compiles code.
"""

from __future__ import annotations

import functools
import hashlib
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba.core import codegen, event, types
from numba.extending import intrinsic

F = TypeVar("F", bound=Callable[..., Any])

#: No fast mathematics: results do not depend on what becomes vector code on a machine (``fma`` says where a product is added
#: unrounded); what the C library computes, as ``expm1``, is still its own.  Nothing here is passed as a C callback, so the
#: wrappers for it, a twentieth of the compile time, are left out.
_FLAGS: dict[str, Any] = {"error_model": "numpy", "nogil": True, "no_cfunc_wrapper": True}


def _allow_wide_vectors() -> None:
    """Let LLVM use vectors of 512 bits, eight lanes at once, where the processor is no slower for it: from Ice Lake on.

    LLVM keeps to 256 bits on all of Intel's, because of the older ones.  What is chosen in the environment stays, and so does
    what a process has compiled before.
    """
    config: Any = numba.config
    if config.CPU_FEATURES is None and config.CPU_NAME is None:
        features: str = codegen.get_host_cpu_features()  # type: ignore[no-untyped-call]
        if "+avx512vbmi2" in features:
            config.CPU_FEATURES = f"{features},-prefer-256-bit"


_allow_wide_vectors()


@intrinsic
def fma(typing_context: Any, a: Any, b: Any, c: Any) -> Any:
    """a b + c, rounded once: one instruction, also in vector code.

    LLVM could find such places by itself, but not the same ones in scalar code and in vectors of either width.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.fma(*arguments)

    return types.float64(types.float64, types.float64, types.float64), generate


def inner(function: F) -> F:
    """Compile a helper that is called from kernels."""
    return numba.njit(**_FLAGS)(function)  # type: ignore[no-any-return]


def scalar(function: F) -> F:
    """Compile a few lines of arithmetic that never stay a call, so that loops over them become vector code."""
    return numba.njit(forceinline=True, **_FLAGS)(function)  # type: ignore[no-any-return]


def spliced(function: F) -> F:
    """Compile a helper as part of its caller: for large functions that are called in one place.

    LLVM optimises the code of every callee again with each caller above it; a deep chain of large functions would be
    optimised once per level.  Splicing takes a level out, which is most of the compile time.
    """
    return numba.njit(inline="always", **_FLAGS)(function)  # type: ignore[no-any-return]


def line_by_line(parameters: str, line: str, names: tuple[str, ...]) -> Any:
    """Compile a helper of one line for each name, ``{0}`` in it; numba's own loops over names take three times as long."""
    made: dict[str, Any] = {}
    exec("\n    ".join([f"def helper({parameters}):", *(line.format(name) for name in names)]), made)
    return inner(made["helper"])


def kernel(function: F) -> F:
    """Compile an entry point, cached on disk under a directory keyed on all kernel sources."""
    return _cached(function, {})


def lean_kernel(function: F) -> F:
    """The same for one that makes no array: without counting references, which is a tenth of a step."""
    return _cached(function, {"_nrt": False})


def bound(function: Callable[..., Any], *arguments: Any) -> Callable[[], Any]:
    """``function(*arguments)`` of a kernel as a call without arguments, for the same arrays again and again.

    To find out what ten arrays are takes numba longer than a tenth of a control step.  Compiles if need be; runs nothing.
    """
    if not hasattr(function, "overloads"):  # NUMBA_DISABLE_JIT
        return functools.partial(function, *arguments)
    types = tuple(function.typeof_pyval(argument) for argument in arguments)  # type: ignore[attr-defined]
    function.compile(types)  # type: ignore[attr-defined]
    return functools.partial(function.overloads[types].entry_point, *arguments)


def _cached(function: F, flags: dict[str, Any]) -> F:
    previous = numba.config.CACHE_DIR  # type: ignore[attr-defined]
    numba.config.CACHE_DIR = str(cache_directory())  # type: ignore[attr-defined]
    try:
        return numba.njit(cache=True, **_FLAGS, **flags)(function)  # type: ignore[no-any-return]
    finally:
        numba.config.CACHE_DIR = previous  # type: ignore[attr-defined]


@functools.cache
def cache_directory() -> Path:
    """Directory of the compiled kernels: ``$USV_GYM_CACHE`` or the user's cache, plus the hash of the kernel sources."""
    root = os.environ.get("USV_GYM_CACHE") or os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(root) / "usv_gym" / f"kernels-{_source_hash()}"


def _source_hash() -> str:
    package = Path(__file__).parent
    digest = hashlib.sha256(f"{numba.__version__} {sys.version_info[:2]}".encode())
    for path in sorted(package.rglob("*.py")):
        text = path.read_bytes()
        if b"jit import" in text or path.name in ("jit.py", "atomic.py", "state.py"):
            digest.update(path.relative_to(package).as_posix().encode())
            digest.update(text)
    return digest.hexdigest()[:16]


def is_warm() -> bool:
    """True when compiled kernels of exactly these sources, in this place, are on disk already."""
    steps = Path(__file__).resolve().parent / "tasks"
    place = hashlib.sha1(str(steps).encode(), usedforsecurity=False).hexdigest()  # as numba names it
    return any((cache_directory() / f"{steps.name}_{place}").glob("*.nbc"))


class _Notice(event.Listener):
    """Speaks up at the first compilation that it sees."""

    listening = False
    told = False

    def on_start(self, event: Any) -> None:
        """Say it, once."""
        if not self.told:
            self.told = True
            print("usv_gym: compiling kernels for this machine, once (about a minute) ...", file=sys.stderr, flush=True)

    def on_end(self, event: Any) -> None:
        """Nothing."""


@contextmanager
def compiling() -> Iterator[None]:
    """Around anything that may compile: says so on stderr if it does, that is if its kernels are not on disk."""
    if _Notice.listening:  # within another one
        yield
        return
    _Notice.listening = True
    try:
        with event.install_listener("numba:compile", _Notice()):
            yield
    finally:
        _Notice.listening = False
