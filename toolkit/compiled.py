"""Functions that numba compiles, with a cache on disk that depends on their sources.

numba's own cache watches only the file of the compiled function. Here the entry on disk carries a digest of the
function and of everything that it calls or reads, directly or not and in any file. An edit of any of it makes the next
call compile again; an edit of a comment, or of a function that is not called, does not.

A function that only other compiled functions call is decorated with `@compiled`. One that Python calls is decorated
with `@compiled(kept=True)`, and its compiled code is kept on disk: beside the source or, where that folder cannot be
written, in the user's numba folder. Where neither can be written, each process compiles it anew.

A formula that Python, NumPy arrays, CasADi's symbols and compiled functions share is decorated with `@law`.
"""

from __future__ import annotations

import contextlib
import enum
import hashlib
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.dispatcher import Dispatcher
from numba.extending import register_jitable

REORDERED = frozenset({"reassoc", "contract", "arcp", "nsz"})
"""Changes that LLVM may make to floating-point sums where a kernel allows it; nan and inf keep their meaning."""


def compiled(function: Callable | None = None, *, kept: bool = False, reordered: bool = False) -> Any:
    """Compile a function with numba when it is first called.

    Division by zero gives inf or nan, and the GIL is released.

    Args:
        function: The function; None where the decorator is called with options.
        kept: Whether the compiled code is kept on disk. This is for functions that Python calls.
        reordered: Whether the compiler may reorder sums.

    Returns:
        The dispatcher that takes the function's place, or the decorator that makes it.
    """
    if function is None:
        return lambda function: compiled(function, kept=kept, reordered=reordered)
    dispatcher = njit(function, error_model="numpy", nogil=True, fastmath=set(REORDERED) if reordered else False)
    if kept:
        try:
            dispatcher._cache = _SourceCache(function)
        except RuntimeError:  # numba found no folder to write to
            pass
    return dispatcher


def kept_folder() -> Path | None:
    """The folder where compiled code is kept; None where none can be written and each process compiles anew."""
    try:
        return Path(_SourceCache(kept_folder).cache_path)
    except RuntimeError:
        return None


def law(function: Callable) -> Callable:
    """Leave a function as it is for Python, and let compiled functions call it under their own rules of arithmetic.

    Written with operators and NumPy's functions of one element, it takes numbers, arrays and CasADi's symbols.
    """
    return register_jitable(function)


def digest(function: Callable) -> str:
    """Hexadecimal digest of a plain or compiled function: of its code, and all code and constants that it reaches.

    It is the same in every process while nothing that the function reaches through global names has changed.
    """
    found: dict[str, str] = {}
    waiting: list[Any] = [function]
    while waiting:
        item = waiting.pop()
        item = item.py_func if isinstance(item, Dispatcher) else item
        name = f"{item.__module__}.{item.__qualname__}"
        if name in found:
            continue
        found[name] = ""  # before its callees, which may call it
        text, called = _described(item)
        found[name] = text
        waiting += called
    return hashlib.sha256(repr(sorted(found.items())).encode()).hexdigest()


class _SourceCache(FunctionCache):
    """numba's cache of one function, whose index is dropped when the digest of the function changes."""

    def __init__(self, py_func: Callable):
        super().__init__(py_func)
        self._digested = False

    def _load_overload(self, sig, target_context):
        self._digest()
        return super()._load_overload(sig, target_context)

    def _save_overload(self, sig, data):
        self._digest()
        with contextlib.suppress(OSError):  # the disk is full, or no longer to be written: compile it anew next time
            super()._save_overload(sig, data)

    def _digest(self) -> None:
        """Stamp the index with the digest instead of the file's time; late, since callees may be defined late."""
        if not self._digested:
            self._digested = True
            stamp = digest(self._py_func)
            self._cache_file = IndexDataCacheFile(self._cache_path, self._impl.filename_base, stamp)


def _described(function: Callable) -> tuple[str, list[Callable]]:
    """A function's own code and constants as text, and the functions that it may call."""
    codes = _codes(function.__code__)
    known = dict(function.__globals__)
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        known[name] = cell.cell_contents
    names = {name for code in codes for name in (*code.co_names, *code.co_freevars)}
    parts = [_text(code) for code in codes] + [repr(function.__defaults__)]
    called: list[Callable] = []
    for name in sorted(names & known.keys()):
        value = known[name]
        if isinstance(value, types.ModuleType) and not value.__name__.startswith("toolkit."):
            continue  # a library, whose version numba checks
        members = [value]
        if isinstance(value, types.ModuleType):  # the attributes that the code may use
            members = [vars(value)[attribute] for attribute in sorted(names & vars(value).keys())]
        for member in members:
            if isinstance(member, (Dispatcher, types.FunctionType)):
                called.append(member)
            else:
                parts.append(f"{name}={_constant(member)}")
    return "\n".join(parts), called


def _codes(code: types.CodeType) -> list[types.CodeType]:
    """A code object and those nested in it."""
    nested = [item for item in code.co_consts if isinstance(item, types.CodeType)]
    return [code, *(inner for item in nested for inner in _codes(item))]


def _text(code: types.CodeType) -> str:
    """What a code object does, without its line numbers and its docstring."""
    constants = [item for item in code.co_consts if not isinstance(item, types.CodeType)]
    if code.co_consts and isinstance(code.co_consts[0], str):
        constants = constants[1:]
    return repr((code.co_code.hex(), constants, code.co_names, code.co_varnames))


def _constant(value: Any) -> str:
    """A global value as a text that is the same in every process."""
    if isinstance(value, type) and issubclass(value, enum.Enum):
        return repr([(item.name, item.value) for item in value])
    if isinstance(value, type):
        return repr((value.__qualname__, getattr(value, "_fields", ())))
    if isinstance(value, np.ndarray):
        return repr((value.shape, value.dtype.str, value.tobytes()))
    if isinstance(value, (tuple, list)):
        return repr([_constant(item) for item in value])
    if isinstance(value, (bool, int, float, str, bytes, type(None), np.generic)):
        return repr(value)
    return type(value).__qualname__
