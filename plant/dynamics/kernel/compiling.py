"""Compile a function to machine code that needs no numba to run. Only here numba is imported, where code is missing.

The code is a function of `machine_code`: it reads the arguments from their words, calls what numba has compiled, and
writes the words of the results. Numba's own arrays need memory whose references are counted; `_MEMORY` gives them it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import TemporaryFile
from types import FunctionType
from typing import Any, cast

import numba
from llvmlite import binding, ir
from numba import types
from numba.extending import intrinsic

from plant.dynamics.kernel.machine_code import MachineCode

ROOM = 10_000_000
"""Free bytes that numba's cache needs: twice what it takes for all functions."""

_MEMORY = """
declare ptr @malloc(i64)
declare void @free(ptr)

define ptr @NRT_MemInfo_alloc_aligned(i64 %size, i32 %align) {
  %wide = zext i32 %align to i64
  %room = add i64 %size, %wide
  %all = add i64 %room, 48
  %memory = call ptr @malloc(i64 %all)
  %none = icmp eq ptr %memory, null
  br i1 %none, label %failed, label %found
failed:
  ret ptr null
found:
  %address = ptrtoint ptr %memory to i64
  %beyond = add i64 %address, 47
  %end = add i64 %beyond, %wide
  %mask = sub i64 0, %wide
  %data = and i64 %end, %mask
  store i64 1, ptr %memory
  %dtor = getelementptr i64, ptr %memory, i64 1
  store i64 0, ptr %dtor
  %info = getelementptr i64, ptr %memory, i64 2
  store i64 0, ptr %info
  %at = getelementptr i64, ptr %memory, i64 3
  store i64 %data, ptr %at
  %length = getelementptr i64, ptr %memory, i64 4
  store i64 %size, ptr %length
  %allocator = getelementptr i64, ptr %memory, i64 5
  store i64 0, ptr %allocator
  ret ptr %memory
}

define ptr @NRT_MemInfo_alloc_safe_aligned(i64 %size, i32 %align) {
  %memory = call ptr @NRT_MemInfo_alloc_aligned(i64 %size, i32 %align)
  ret ptr %memory
}

define ptr @NRT_MemInfo_alloc(i64 %size) {
  %memory = call ptr @NRT_MemInfo_alloc_aligned(i64 %size, i32 16)
  ret ptr %memory
}

define void @NRT_MemInfo_call_dtor(ptr %memory) {
  call void @free(ptr %memory)
  ret void
}

define ptr @NRT_Allocate(i64 %size) {
  %memory = call ptr @malloc(i64 %size)
  ret ptr %memory
}

define void @NRT_Free(ptr %memory) {
  call void @free(ptr %memory)
  ret void
}
"""
"""Numba's counted memory (`numba/core/runtime/nrt.cpp`), six words: references; two that only owners other than arrays
use; address and size of the data; one for allocators of others. Then the data, aligned."""


def dispatcher_of(function: Callable[..., Any], folder: Path | None) -> tuple[Any, dict[str, Any]]:
    """Return numba's form of a function, and the names that it sees, to be changed before its first call.

    Numba keeps what it compiles in the folder, if that has room for it; elsewhere numba would write beside the source.
    """
    kept = has_room(folder)
    if kept:
        numba.config.CACHE_DIR = str(folder)  # type: ignore[attr-defined]  # numba.config fills itself at import
    plain = cast("FunctionType", function)
    namespace = dict(plain.__globals__)
    copy = FunctionType(plain.__code__, namespace, plain.__name__, plain.__defaults__, plain.__closure__)
    copy.__qualname__, copy.__module__ = plain.__qualname__, plain.__module__
    return cast("Any", numba.njit)(cache=kept, error_model="numpy")(copy), namespace


@cache
def has_room(folder: Path | None) -> bool:
    """Whether a folder, made if it does not exist, can be written and has room for what numba keeps."""
    if folder is None:
        return False
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=folder) as file:
            file.write(bytes(ROOM))
    except OSError:
        return False
    return True


def compile_call(dispatcher: Any, args: tuple[Any, ...]) -> MachineCode:
    """Return the machine code of calls with arguments of the types of these."""
    taken: Any = cast("Any", types.BaseTuple).from_types([cast("Any", numba).typeof(arg) for arg in args])
    entry = _entry(dispatcher, taken)
    pointers = types.voidptr, types.voidptr
    entry.compile(pointers)
    ((_, done),) = entry.overloads.items()
    module = binding.parse_assembly(entry.inspect_llvm(done.signature.args))
    memory = binding.parse_assembly(_MEMORY)
    module.link_in(memory)
    module.verify()
    target = binding.Target.from_triple(binding.get_process_triple())
    machine = target.create_target_machine(
        cpu=binding.get_host_cpu_name(),
        features=binding.get_host_cpu_features().flatten(),
        opt=3,
        reloc="pic",
        codemodel="small",
        jit=True,
    )
    returned = dispatcher.overloads[tuple(taken)].signature.return_type
    return MachineCode(done.fndesc.llvm_func_name, _letters(returned), machine.emit_object(module))


def _entry(dispatcher: Any, taken: Any) -> Any:
    """Return the function that is to be called in place of another one, whose arguments are `taken`."""

    @intrinsic
    def read(typing: Any, address: Any) -> Any:
        def load(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            place = builder.bitcast(arguments[0], context.get_value_type(taken).as_pointer())
            return builder.load(place)

        return taken(address), load

    @intrinsic
    def write(typing: Any, address: Any, value: Any) -> Any:
        def store(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            place = builder.bitcast(arguments[0], ir.IntType(64).as_pointer())
            for i, word in enumerate(_words(builder, value, arguments[1])):
                at = builder.gep(place, [ir.Constant(ir.IntType(64), i)])
                builder.store(word, builder.bitcast(at, word.type.as_pointer()))
            return context.get_dummy_value()

        return types.none(address, value), store

    def entry(arguments: Any, results: Any) -> None:
        write(results, dispatcher(*read(arguments)))  # type: ignore[call-arg]  # numba gives the first one itself

    return cast("Any", numba.njit)(error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)(entry)


def _members(returned: Any) -> tuple[Any, ...]:
    """Return the types of a result's members, or its own."""
    return tuple(cast("Any", returned)) if isinstance(returned, types.BaseTuple) else (returned,)


def _letters(returned: Any) -> str:
    """Return the types of a result by their letters."""
    if isinstance(returned, types.NoneType):
        return ""
    kinds = (
        (types.Boolean, "b"),
        (types.Integer, "i"),
        (types.Float, "f"),
        (types.Complex, "c"),
    )
    letters = "".join(next(letter for kind, letter in kinds if isinstance(each, kind)) for each in _members(returned))
    return f"({letters})" if isinstance(returned, types.BaseTuple) else letters


def _words(builder: Any, returned: Any, value: Any) -> list[Any]:
    """Return the words of a result."""
    if isinstance(returned, types.NoneType):
        return []
    several = isinstance(returned, types.BaseTuple)
    words = []
    for i, kind in enumerate(_members(returned)):
        each = builder.extract_value(value, i) if several else value
        if isinstance(kind, types.Complex):
            words += [builder.extract_value(each, 0), builder.extract_value(each, 1)]
        elif isinstance(kind, types.Boolean):
            words.append(builder.zext(each, ir.IntType(64)))
        else:
            words.append(each)
    return words
