"""Functions that numba compiles, with a cache on disk that depends on their sources.

numba's own cache watches only the file of the compiled function. Here the entry on disk carries a digest of the
function and of everything that it calls or reads, directly or not and in any file. An edit of any of it makes the next
call compile again; an edit of a comment, or of a function that is not called, does not.

A function that only other compiled functions call is decorated with `@compiled`. One that Python calls is decorated
with `@compiled(kept=True)`, and its compiled code is kept on disk: beside the source or, where that folder cannot be
written, in the user's numba folder. Where neither can be written, each process compiles it anew. What a command needs
can be compiled ahead of its first use, by several processes (see `toolkit.warmup`).

A formula that Python, NumPy arrays, CasADi's symbols and compiled functions share is decorated with `@law`.
"""

# pyright: reportAttributeAccessIssue=false
# numba makes its settings and the fields of its types at run time.

from __future__ import annotations

import contextlib
import enum
import fcntl
import hashlib
import importlib
import re
import sys
import types
from collections.abc import Callable, Iterator
from functools import cached_property
from pathlib import Path
from typing import Any, cast

import numpy as np
from numba import config
from numba.core import types as nb
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.dispatcher import Dispatcher
from numba.core.registry import CPUDispatcher
from numba.extending import register_jitable

REORDERED = frozenset({"reassoc", "contract", "arcp", "nsz"})
"""Changes that LLVM may make to floating-point sums where a kernel allows it; nan and inf keep their meaning."""


def compiled(
    function: Callable | None = None, *, kept: bool = False, reordered: bool = False, allocates: bool = False
) -> Any:
    """Compile a function with numba when it is first called.

    Division by zero gives inf or nan, and the GIL is released.

    Args:
        function: The function; None where the decorator is called with options.
        kept: Whether the compiled code is kept on disk. This is for functions that Python calls.
        reordered: Whether the compiler may reorder sums.
        allocates: Whether the function makes arrays, returns them, or calls a function that returns them. References
            to arrays are counted in such functions only: where a function looks things up in named tuples of arrays,
            the counting takes most of its time.

    Returns:
        The dispatcher that takes the function's place, or the decorator that makes it.
    """
    if function is None:
        return lambda function: compiled(function, kept=kept, reordered=reordered, allocates=allocates)
    if config.DISABLE_JIT:
        return function
    options = _COMMON | {"fastmath": set(REORDERED) if reordered else False, "_nrt": allocates}
    if not kept:
        return _Inner(function, targetoptions=options | {"no_cpython_wrapper": True})
    dispatcher = _Kernel(function, targetoptions=options)
    with contextlib.suppress(RuntimeError):  # numba found no folder to write to
        dispatcher._cache = _SourceCache(dispatcher)
    return dispatcher


_OPTIONAL = ("fastmath", "_nrt")  # options that change what is compiled
_COMMON = {"nopython": True, "boundscheck": None, "error_model": "numpy", "nogil": True, "no_cfunc_wrapper": True}


class _Kernel(CPUDispatcher):
    """A function that is handed no arrays by others, and hands out none, unless references to arrays are counted."""

    def compile(self, sig: Any) -> Any:
        entry = super().compile(sig)
        if not self.targetoptions["_nrt"]:
            for found in self.overloads.values():
                returned = [found.signature.return_type, *_returned(found.type_annotation)]
                if any(map(_holds_arrays, returned)):
                    raise TypeError(
                        f"{kernel_name(self)} returns an array, or calls what does: decorate it with allocates=True"
                    )
        return entry


def _returned(annotation: Any) -> list[nb.Type]:
    """What the compiled functions return that a function calls; none are known of one that comes from the disk."""
    calls = getattr(annotation, "calltypes", {}).items()
    kinds = getattr(annotation, "typemap", {})
    return [
        signature.return_type
        for call, signature in calls
        if getattr(call, "op", None) == "call" and isinstance(kinds.get(call.func.name), nb.Dispatcher)
    ]


class _Inner(_Kernel):
    """A function for compiled functions: without an entrance from Python, it compiles in four fifths of the time.

    Where Python calls it nevertheless, as tests do, it is compiled once more, with an entrance.
    """

    def __call__(self, *args: Any) -> Any:
        return self._entered(*args)

    @cached_property
    def _entered(self) -> Callable:
        return _Kernel(self.py_func, targetoptions=self.targetoptions | {"no_cpython_wrapper": False})


def _holds_arrays(item: nb.Type) -> bool:
    """Whether a type is that of an array, or of a tuple with one."""
    return isinstance(item, nb.Array) or (isinstance(item, nb.BaseTuple) and any(map(_holds_arrays, item.types)))


def kept_folder() -> Path | None:
    """The folder where compiled code is kept; None where each process compiles anew, or nothing is compiled.

    The first is so where no folder can be written, the second where NUMBA_DISABLE_JIT is set.
    """
    if config.DISABLE_JIT:
        return None
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
        options = item.targetoptions if isinstance(item, Dispatcher) else {}
        item = item.py_func if isinstance(item, Dispatcher) else item
        name = f"{item.__module__}.{item.__qualname__}"
        if name in found:
            continue
        found[name] = ""  # before its callees, which may call it
        text, called = _described(item)
        found[name] = text + "".join(f"\n{each}" for each in _OPTIONAL if options.get(each))
        waiting += called
    return hashlib.sha256(repr(sorted(found.items())).encode()).hexdigest()


def kernel_name(kernel: Any) -> str:
    """`module:function` of a compiled function."""
    return f"{kernel.py_func.__module__}:{kernel.py_func.__qualname__}"


def used_kernels() -> list[tuple[str, list, bool]]:
    """The kept functions that Python has called in this process.

    Returns:
        Name, types of the arguments as `is_kept` takes them, and whether it had to be compiled; in the order of names.
    """
    found = {}
    for module in [module for name, module in sys.modules.items() if name.startswith("toolkit.")]:
        for value in vars(module).values():
            if isinstance(value, Dispatcher) and isinstance(value._cache, _SourceCache):
                stats = value.stats
                for given in stats.cache_hits:
                    found[kernel_name(value), given] = False
                for given in stats.cache_misses:
                    found[kernel_name(value), given] = True
    return sorted((name, [_written(item) for item in given], made) for (name, given), made in found.items())


def is_kept(name: str, arguments: list) -> bool:
    """Whether the disk holds a kept function's code for arguments of these types.

    Args:
        name: As `kernel_name` gives it; its module is imported.
        arguments: A type is a text such as "float64", "float64[2]" for a contiguous array of two dimensions, or, for a
            named tuple, the list of its class as `module:class` and the types of its fields; "" starts the list of a
            plain tuple.

    Raises:
        LookupError: There is no such function or type.
    """
    kernel = _kept(name)
    return kernel._cache.holds(tuple(_read(item) for item in arguments), kernel.targetctx.codegen())


def keep(name: str, arguments: list) -> None:
    """Compile a kept function for arguments of these types (see `is_kept`), unless the disk holds the code."""
    _kept(name).compile(tuple(_read(item) for item in arguments))


def _kept(name: str) -> Any:
    """The kept function of this name."""
    kernel = _found(name)
    if not (isinstance(kernel, Dispatcher) and isinstance(kernel._cache, _SourceCache)):
        raise LookupError(name)
    return kernel


def _found(name: str) -> Any:
    """What `module:name` names."""
    module, _, attribute = name.partition(":")
    try:
        return vars(importlib.import_module(module))[attribute]
    except ImportError as error:
        raise LookupError(name) from error


def _written(item: nb.Type) -> Any:
    """A type as texts and lists."""
    if isinstance(item, nb.Array) and item.layout == "C" and item.mutable and item.aligned:
        return f"{item.dtype}[{item.ndim}]"
    if isinstance(item, nb.BaseAnonymousTuple):
        return ["", *map(_written, item.types)]
    if isinstance(item, nb.BaseNamedTuple):
        made = item.instance_class
        return [f"{made.__module__}:{made.__qualname__}", *map(_written, item.types)]
    return str(item)


def _read(item: Any) -> nb.Type:
    """The type that `_written` wrote."""
    if isinstance(item, list):
        fields = [_read(field) for field in item[1:]]
        made = _found(item[0]) if item[0] else tuple
        if item[0] and len(vars(made).get("_fields", ())) != len(fields):
            raise LookupError(item[0])
        return cast(nb.Type, nb.BaseTuple.from_types(fields, made))
    parts = re.fullmatch(r"(\w+)(?:\[(\d)\])?", item)
    if parts is None:
        raise LookupError(item)
    scalar = vars(nb)["boolean" if parts[1] == "bool" else parts[1]]
    return nb.Array(scalar, int(parts[2]), "C") if parts[2] else scalar


class _Index(IndexDataCacheFile):
    """numba's index of one function; one that names a type which is no longer there counts as empty."""

    def _load_index(self):
        try:
            return super()._load_index()
        except (AttributeError, ImportError):  # of a class that the code has renamed or lost since
            return {}


class _SourceCache(FunctionCache):
    """numba's cache of one function, whose index is dropped when the digest of the function changes."""

    def __init__(self, function: Callable):
        super().__init__(function.py_func if isinstance(function, Dispatcher) else function)
        self._function, self._digested = function, False

    def holds(self, sig, codegen) -> bool:
        """Whether the disk holds the code for a signature."""
        self._digest()
        name = self._cache_file._load_index().get(self._index_key(sig, codegen))
        return name is not None and Path(self._cache_path, name).is_file()

    def _load_overload(self, sig, target_context):
        self._digest()
        with self._locked(fcntl.LOCK_SH):
            return super()._load_overload(sig, target_context)

    def _save_overload(self, sig, data):
        self._digest()
        with contextlib.suppress(OSError):  # the disk is full, or no longer to be written: compile it anew next time
            with self._locked(fcntl.LOCK_EX):
                super()._save_overload(sig, data)

    @contextlib.contextmanager
    def _locked(self, how: int) -> Iterator[None]:
        """Keep other processes from changing the index meanwhile, so that it never names the code of something else."""
        with contextlib.ExitStack() as stack:
            with contextlib.suppress(OSError):  # a folder that cannot be written, or without locks
                path = Path(self._cache_path, f"{self._impl.filename_base}.lock")
                fcntl.flock(stack.enter_context(path.open("ab")), how)
            yield

    def _digest(self) -> None:
        """Stamp the index with the digest instead of the file's time; late, since callees may be defined late."""
        if not self._digested:
            self._digested = True
            stamp = digest(self._function)
            self._cache_file = _Index(self._cache_path, self._impl.filename_base, stamp)


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
