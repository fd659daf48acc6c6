"""GMR's pickle of a retargeted motion, read without unpickling: nothing is imported, and no code of the file runs.

A pickle is a program of a stack machine. `read_pickle` runs the instructions for plain values and for NumPy arrays of
numbers only, and refuses all others.
"""

import os
import pickle
import pickletools
from collections.abc import Callable, Sequence
from math import prod
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from maniport.datasets.joint_motion import RADIANS, JointMotion, times_of
from maniport.datasets.unitree_csv import require_radians
from maniport.errors import FileFormatError, InvalidInputError, some_of
from maniport.util.atomic_io import written_whole
from maniport.util.input_limits import RECORDING_BYTES, read_whole

PROTOCOL = 4  # of files that are written; all versions of Python since 3.4 read it
KINDS = "fiub"  # kinds of numbers of arrays: floats, integers and flags
LONGEST_NUMBER = 8  # bytes of a number of an array
MOST_DIMENSIONS = 8  # of an array
MOST_COPIES = (
    4  # bytes that calls make, as a multiple of the size of the file; protocol 2 makes two
)


class Name(NamedTuple):
    """A function or class that a pickle names."""

    module: str
    name: str


class _Mark:
    """Position on the stack where a list of arguments begins."""


class _Dtype:
    """A dtype of NumPy while its description is complete in parts."""

    def __init__(self, code: str):
        self.code = code
        self.order = "="

    def finished(self) -> np.dtype[np.generic]:
        """Return the dtype of numbers; `ValueError` for another one."""
        found = np.dtype(self.code)
        if found.kind not in KINDS or found.itemsize > LONGEST_NUMBER or found.fields:
            raise ValueError(f"arrays of {self.code!r:.20}")
        if self.order == ">":
            return found.newbyteorder(">")
        return found.newbyteorder("<")  # or of one byte


class _Array:
    """An array of NumPy before its state is known."""

    content: "NDArray[np.generic] | None" = None


Value = object
_Stack = list[Value]


def read_pickle(content: bytes, source: str) -> Value:
    """Return the value of a pickle of plain values and arrays.

    Parameters
    ----------
    content : bytes
    source : str
        The file, for messages.

    Raises
    ------
    FileFormatError
        When the pickle is damaged, or contains anything else, such as a function or an object.
    """
    stack: _Stack = []
    memo: dict[int, Value] = {}
    copied = 0
    try:
        for code, argument, _ in pickletools.genops(content):
            if code.name == "STOP":
                return _plain(stack.pop())
            _run(code.name, argument, stack, memo)
            if code.name == "REDUCE" and isinstance(stack[-1], bytes):
                copied += len(stack[-1])
                if copied > MOST_COPIES * len(content):
                    raise ValueError("it makes many copies of its bytes")
    except FileFormatError:
        raise
    except RecursionError:
        raise FileFormatError(f"{source}: is no motion: its values are nested too deeply") from None
    except (
        ValueError,
        TypeError,
        IndexError,
        KeyError,
        AttributeError,
        OverflowError,
        MemoryError,
    ) as error:
        raise FileFormatError(
            f"{source}: cannot be read as a pickle of numbers and arrays: {error!s:.200}"
        ) from None
    raise FileFormatError(f"{source}: cannot be read as a pickle: it is cut off")


def _run(name: str, argument: object, stack: _Stack, memo: dict[int, Value]) -> None:
    """Run one instruction."""
    if name in _CONSTANTS:
        stack.append(argument)
    elif name in _MAKERS:
        stack.append(_MAKERS[name]())
    elif name in _TUPLES:
        items = [stack.pop() for _ in range(_TUPLES[name])]
        stack.append(tuple(reversed(items)))
    elif name in ("BINPUT", "LONG_BINPUT", "PUT"):
        memo[_index(argument)] = stack[-1]
    elif name == "MEMOIZE":
        memo[len(memo)] = stack[-1]
    elif name in ("BINGET", "LONG_BINGET", "GET"):
        stack.append(memo[_index(argument)])
    elif name in _INSTRUCTIONS:
        _INSTRUCTIONS[name](stack)
    elif name == "GLOBAL":
        module, _, attribute = str(argument).partition(" ")
        stack.append(_allowed(Name(module, attribute)))
    elif name not in ("PROTO", "FRAME"):
        raise ValueError(f"it has the instruction {name}")


def _index(argument: object) -> int:
    return int(str(argument))


def _from_mark(stack: _Stack) -> _Stack:
    """Take all values down to the last mark from the stack."""
    place = len(stack) - 1
    while not isinstance(stack[place], _Mark):
        place -= 1
        if place < 0:
            raise ValueError("an instruction has no mark")
    items = stack[place + 1 :]
    del stack[place:]
    return items


def _tuple(stack: _Stack) -> None:
    stack.append(tuple(_from_mark(stack)))


def _append(stack: _Stack) -> None:
    item = stack.pop()
    _as_list(stack[-1]).append(item)


def _appends(stack: _Stack) -> None:
    items = _from_mark(stack)
    _as_list(stack[-1]).extend(items)


def _list(stack: _Stack) -> None:
    stack.append(_from_mark(stack))


def _set_item(stack: _Stack) -> None:
    value = stack.pop()
    key = stack.pop()
    _as_dict(stack[-1])[_as_key(key)] = value


def _set_items(stack: _Stack) -> None:
    items = _from_mark(stack)
    mapping = _as_dict(stack[-1])
    for key, value in zip(items[::2], items[1::2], strict=True):
        mapping[_as_key(key)] = value


def _dict(stack: _Stack) -> None:
    items = _from_mark(stack)
    mapping: dict[str | int, Value] = {}
    for key, value in zip(items[::2], items[1::2], strict=True):
        mapping[_as_key(key)] = value
    stack.append(mapping)


def _pop(stack: _Stack) -> None:
    stack.pop()


def _pop_mark(stack: _Stack) -> None:
    _from_mark(stack)


def _duplicate(stack: _Stack) -> None:
    stack.append(stack[-1])


def _stack_global(stack: _Stack) -> None:
    attribute = stack.pop()
    module = stack.pop()
    if not isinstance(module, str) or not isinstance(attribute, str):
        raise ValueError("it names a function by something that is no text")
    stack.append(_allowed(Name(module, attribute)))


def _reduce(stack: _Stack) -> None:
    """Call one of the allowed functions."""
    arguments = stack.pop()
    function = stack.pop()
    if not isinstance(function, Name) or not isinstance(arguments, tuple):
        raise ValueError("it calls something that is no function")
    stack.append(_FUNCTIONS[function](*arguments))


def _build(stack: _Stack) -> None:
    """Set the state of an array or a dtype."""
    state = stack.pop()
    target = stack[-1]
    if isinstance(target, _Dtype) and isinstance(state, tuple) and len(state) >= 2:
        order = state[1]
        if isinstance(order, bytes):
            order = order.decode("ascii")
        if not isinstance(order, str):
            raise ValueError("a dtype whose order is no text")
        target.order = order
    elif isinstance(target, _Array) and isinstance(state, tuple) and len(state) == 5:
        _, shape, dtype, in_columns, content = state
        target.content = _array(content, dtype, shape, "F" if in_columns else "C")
    else:
        raise ValueError("it sets the state of an object")


def _as_list(value: Value) -> list[Value]:
    if not isinstance(value, list):
        raise ValueError("it appends to something that is no list")
    return value


def _as_dict(value: Value) -> dict[str | int, Value]:
    if not isinstance(value, dict):
        raise ValueError("it sets items of something that is no dictionary")
    return value


def _as_key(value: Value) -> str | int:
    if not isinstance(value, str | int):
        raise ValueError("a key is neither text nor a whole number")
    return value


def _array(content: Value, dtype: Value, shape: Value, order: Value = "C") -> "NDArray[np.generic]":
    """Return an array of the bytes of its numbers."""
    if isinstance(content, _Array | np.ndarray):
        raise ValueError("an array of arrays")
    if not isinstance(dtype, _Dtype) or not isinstance(shape, tuple):
        raise ValueError("an array without a dtype or a shape")
    if not isinstance(content, bytes | bytearray):
        raise ValueError("an array of objects")
    kind = dtype.finished()
    sizes = [size for size in shape if isinstance(size, int) and size >= 0]
    if len(sizes) != len(shape) or len(sizes) > MOST_DIMENSIONS:
        raise ValueError(f"an array whose shape is not of up to {MOST_DIMENSIONS} sizes")
    if prod(sizes) * kind.itemsize != len(content):
        raise ValueError(f"an array of the shape {sizes!r:.60} with {len(content)} bytes")
    values = np.frombuffer(content, dtype=kind)
    return values.reshape(sizes, order="F" if order == "F" else "C")


def _make_dtype(code: Value, *_: Value) -> _Dtype:
    if isinstance(code, bytes):
        code = code.decode("ascii")
    if not isinstance(code, str):
        raise ValueError("a dtype whose code is no text")
    if len(code) > 3:
        raise ValueError(f"arrays of {code!r:.20}")
    return _Dtype(code)


def _reconstruct(*_: Value) -> _Array:
    return _Array()


def _scalar(dtype: Value, content: Value) -> Value:
    return _array(content, dtype, ()).item()


def _encode(text: Value, encoding: Value = "latin1") -> bytes:
    """Return bytes as protocol 2 stores them."""
    if not isinstance(text, str) or encoding not in ("latin1", "latin-1"):
        raise ValueError("it encodes text")
    return text.encode("latin1")


def _bytes(*content: Value) -> bytes:
    """Return empty bytes, or a copy of bytes."""
    if not content:
        return b""
    if not isinstance(content[0], bytes | bytearray):
        raise ValueError("bytes of something else")
    return bytes(content[0])


def _from_buffer(content: Value, dtype: Value, shape: Value, order: Value, *_: Value) -> Value:
    return _array(content, dtype, shape, order)


def _ordered_dict(*_: Value) -> dict[str | int, Value]:
    return {}


_FUNCTIONS: dict[Name, Callable[..., Value]] = {Name("_codecs", "encode"): _encode}
_CLASSES: set[Name] = set()  # only arguments of functions
for _core in ("numpy.core", "numpy._core"):
    _FUNCTIONS[Name(f"{_core}.multiarray", "_reconstruct")] = _reconstruct
    _FUNCTIONS[Name(f"{_core}.multiarray", "scalar")] = _scalar
    _FUNCTIONS[Name(f"{_core}.numeric", "_frombuffer")] = _from_buffer
for _builtins in ("builtins", "__builtin__"):
    _FUNCTIONS[Name(_builtins, "bytes")] = _bytes
    _FUNCTIONS[Name(_builtins, "bytearray")] = _bytes
_FUNCTIONS[Name("numpy", "dtype")] = _make_dtype
_FUNCTIONS[Name("collections", "OrderedDict")] = _ordered_dict
_CLASSES.add(Name("numpy", "ndarray"))

_CONSTANTS = frozenset(
    {
        *("INT", "BININT", "BININT1", "BININT2", "LONG", "LONG1", "LONG4", "FLOAT", "BINFLOAT"),
        *("STRING", "BINSTRING", "SHORT_BINSTRING", "UNICODE", "BINUNICODE", "SHORT_BINUNICODE"),
        *("BINUNICODE8", "BINBYTES", "SHORT_BINBYTES", "BINBYTES8", "BYTEARRAY8"),
    }
)
"""Instructions that push their argument."""
_MAKERS: dict[str, Callable[[], Value]] = {
    "MARK": _Mark,
    "NONE": lambda: None,
    "NEWTRUE": lambda: True,
    "NEWFALSE": lambda: False,
    "EMPTY_LIST": list,
    "EMPTY_DICT": dict,
    "EMPTY_TUPLE": tuple,
}
"""Instructions that push a new value."""
_TUPLES = {"TUPLE1": 1, "TUPLE2": 2, "TUPLE3": 3}
_INSTRUCTIONS: dict[str, Callable[[_Stack], None]] = {
    "TUPLE": _tuple,
    "LIST": _list,
    "DICT": _dict,
    "APPEND": _append,
    "APPENDS": _appends,
    "SETITEM": _set_item,
    "SETITEMS": _set_items,
    "POP": _pop,
    "POP_MARK": _pop_mark,
    "DUP": _duplicate,
    "STACK_GLOBAL": _stack_global,
    "REDUCE": _reduce,
    "BUILD": _build,
}
"""Instructions that work on the stack."""


def _allowed(name: Name) -> Name:
    """Return a name that a motion may have, without importing it."""
    if name not in _FUNCTIONS and name not in _CLASSES:
        raise ValueError(f"it names {name.module}.{name.name}, which is not imported")
    return name


def _plain(value: Value, depth: int = 0) -> Value:
    """Return a value with arrays in the place of their parts; at most a few levels are looked at."""
    if isinstance(value, _Array):
        if value.content is None:
            raise ValueError("an array without a state")
        return value.content
    if isinstance(value, dict) and depth < 2:
        return {key: _plain(item, depth + 1) for key, item in value.items()}
    return value


def read_gmr_pickle(path: str | os.PathLike[str], joint_names: Sequence[str] = ()) -> JointMotion:
    """Read a motion of GMR: ``fps``, ``root_pos``, ``root_rot`` (x, y, z, w) and ``dof_pos`` [rad].

    Parameters
    ----------
    path : str or path
    joint_names : sequence of str
        Joints in the order of ``dof_pos``; the file has no names. Default: no names.

    Raises
    ------
    FileFormatError
        When the file is damaged, contains more than numbers and arrays, or lacks an entry.
    """
    source = os.fspath(path)
    content = read_pickle(read_whole(path, (), RECORDING_BYTES), source)
    if not isinstance(content, dict):
        raise FileFormatError(f"{source}: must hold a dictionary; found {type(content).__name__}")
    needed = ("fps", "root_pos", "root_rot", "dof_pos")
    missing = [key for key in needed if content.get(key) is None]
    if missing:
        raise FileFormatError(
            f"{source}: lacks {', '.join(missing)}; found {some_of(map(str, content))}"
        )
    size = os.path.getsize(path)
    positions = _numbers(content, "dof_pos", size, source)
    root_positions = _numbers(content, "root_pos", size, source)
    root_rotations = _numbers(content, "root_rot", size, source)
    if positions.ndim != 2 or not positions.size:
        raise FileFormatError(f"{source}: dof_pos must have shape (n, k); found {positions.shape}")
    rate = content["fps"]
    if not isinstance(rate, int | float | np.ndarray):
        raise FileFormatError(f"{source}: fps must be a number; found {type(rate).__name__}")
    times = times_of(source, len(positions), rate)
    root = (root_positions, root_rotations)
    return JointMotion.checked(source, positions, times, joint_names, RADIANS, root)


def _numbers(
    content: dict[str | int, Value], key: str, size: int, source: str
) -> "NDArray[np.generic]":
    """Return an entry as an array of numbers: an array, or a list of rows that a file of so many bytes can hold."""
    value = content[key]
    if isinstance(value, list | tuple):
        value = _table(value, size)
    if not isinstance(value, np.ndarray) or value.dtype.kind not in KINDS:
        raise FileFormatError(f"{source}: {key} must be an array of numbers")
    return value


def _table(rows: Sequence[Value], size: int) -> "NDArray[np.generic] | None":
    """Return rows of plain numbers as an array; None for others, and where rows repeat beyond `size` numbers."""
    table = []
    count = 0
    for row in rows:
        if isinstance(row, np.ndarray) and row.ndim == 1:
            row = row.tolist()
        if not isinstance(row, list | tuple):
            return None
        count += len(row)
        if count > size or not all(isinstance(value, int | float) for value in row):
            return None
        table.append(row)
    try:
        return np.array(table, dtype=np.float64)
    except (ValueError, OverflowError):  # rows of other lengths, integers without end
        return None


def write_gmr_pickle(path: str | os.PathLike[str], motion: JointMotion) -> None:
    """Write a motion of a robot with a floating base, as GMR does, without positions of bodies.

    `InvalidInputError` for a motion without a base, or with joints in other units than radians.
    """
    if motion.root_positions is None or motion.root_rotations is None:
        raise InvalidInputError(
            f"{motion.name}: the pickle needs the motion of the base; found none"
        )
    require_radians(motion)
    content = {
        "fps": motion.rate,
        "root_pos": motion.root_positions,
        "root_rot": motion.root_rotations,
        "dof_pos": motion.positions,
        "local_body_pos": None,
        "link_body_list": None,
    }
    with written_whole(path) as temporary, open(temporary, "wb") as stream:
        pickle.dump(content, stream, protocol=PROTOCOL)
