# SPDX-License-Identifier: Apache-2.0
"""What pybind11 does otherwise than the module: of arguments of wrong types it prints all that they hold, which may be
megabytes; its functions have names that nothing has; and pickling its objects by protocol 0 or 1 ends the process."""
import functools
import numbers

MAKERS = "__init__", "__setstate__"


def _type(value):
    name = type(value).__name__
    if issubclass(type(value), numbers.Integral) and type(value) is not bool:  # the type may be right, its size wrong
        bits = int(value).bit_length()
        return f"{name} {int(value)}" if bits <= 64 else f"{name} of {bits} bits"
    held = list(dict.fromkeys(type(each).__name__ for each in value)) if type(value) in (list, tuple) else []
    return f"{name}[{' | '.join(held[:3] + ['...'] * (len(held) > 3))}]" if held else name


def _found(arguments, named):
    types = [_type(value) for value in arguments]
    types += [f"{name:.40}={_type(value)}" for name, value in named.items()]
    return ", ".join(types[:20] + ["..."] * (len(types) > 20)) or "nothing"


def _in_short(function, name, mark, own=0):
    """The function, of that name, whose TypeError, known by its `mark`, names types of arguments, and integers, alone;
    `own` of them stand before the caller's. What code raises that it calls stays as it is."""

    @functools.wraps(function)
    def call(*arguments, **named):
        try:
            return function(*arguments, **named)
        except TypeError as error:
            if error.__traceback__.tb_next:
                raise
            expected, printed, _ = str(error).partition("\nInvoked with: ")
            if not printed or mark not in expected:
                raise
        raise TypeError(f"{expected}\nFound: {_found(arguments[own:], named)}")

    call.__qualname__ = name
    return call


def _reduce(self, protocol):
    return object.__reduce_ex__(self, max(protocol, 2))


def shorten(scope):
    """All functions, constructors and methods of a module or class of pybind11's, in place."""
    is_class = isinstance(scope, type)
    if is_class and not issubclass(scope, BaseException):
        scope.__reduce_ex__ = _reduce
    for name, member in list(vars(scope).items()):
        known = f"{scope.__qualname__}.{name}" if is_class else name
        mark = f"1. {scope.__module__}.{scope.__qualname__}(" if name in MAKERS else f"{name}(): incompatible "
        if isinstance(member, type):
            shorten(member)
        elif isinstance(member, staticmethod):
            setattr(scope, name, staticmethod(_in_short(member.__func__, known, mark)))
        elif callable(member) and (name in MAKERS or not name.startswith("_")):
            setattr(scope, name, _in_short(member, known, mark, own=int(is_class)))
