# SPDX-License-Identifier: Apache-2.0
"""Short words for arguments of wrong types: pybind11 prints all that they hold, which may be megabytes."""
import functools


def _found(arguments, named):
    types = [type(value).__name__ for value in arguments]
    types += [f"{name:.40}={type(value).__name__}" for name, value in named.items()]
    return ", ".join(types[:20] + ["..."] * (len(types) > 20)) or "nothing"


def _in_short(function, own=0):
    """The function, whose TypeError names types of arguments alone; `own` of them stand before the caller's. What
    Python code raises that it calls stays as it is."""

    @functools.wraps(function)
    def call(*arguments, **named):
        try:
            return function(*arguments, **named)
        except TypeError as error:
            expected, printed, _ = str(error).partition("\nInvoked with: ")
            if not printed or error.__traceback__.tb_next:
                raise
        raise TypeError(f"{expected}\nFound: {_found(arguments[own:], named)}")

    return call


def shorten(scope):
    """All functions, constructors and methods of a module or class of pybind11's, in place."""
    for name, member in list(vars(scope).items()):
        if isinstance(member, type):
            shorten(member)
        elif isinstance(member, staticmethod):
            setattr(scope, name, staticmethod(_in_short(member.__func__)))
        elif callable(member) and (name == "__init__" or not name.startswith("_")):
            setattr(scope, name, _in_short(member, own=int(isinstance(scope, type))))
