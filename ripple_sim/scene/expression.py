"""Expressions of position in scene files, such as "0.02 * exp(-(x**2 + y**2) / 0.1**2)": arithmetic alone."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ripple_sim.errors import SceneError
from ripple_sim.solver.errors import shown

# name: function and how many arguments it takes
FUNCTIONS: dict[str, tuple[Callable[..., Any], int]] = {
    "abs": (np.abs, 1),
    "sqrt": (np.sqrt, 1),
    "exp": (np.exp, 1),
    "log": (np.log, 1),
    "sin": (np.sin, 1),
    "cos": (np.cos, 1),
    "tan": (np.tan, 1),
    "atan2": (np.arctan2, 2),
    "hypot": (np.hypot, 2),
    "minimum": (np.minimum, 2),
    "maximum": (np.maximum, 2),
    "where": (np.where, 3),
}
_CONSTANTS = {"pi": np.pi}
_OPERATORS: dict[type, Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Mod: operator.mod,
    ast.Pow: operator.pow,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}
_LONGEST = 1000  # [characters]


def evaluate(text: str, variables: Mapping[str, NDArray[np.float64]]) -> NDArray[np.float64]:
    """Value of an expression of some variables, arrays of one shape.

    It may hold numbers, the variables, pi, + - * / % **, parentheses, the functions of `FUNCTIONS`, and one comparison
    at a time as the condition of `where`. Nothing of Python is run.

    Raises
    ------
    SceneError
        If it holds anything else, or its value is not finite everywhere.
    """
    try:
        if len(text) > _LONGEST:
            raise _WrongError(f"it has {len(text)} characters, valid are {_LONGEST} at most")
        tree = ast.parse(text.strip(), mode="eval")
        with np.errstate(all="ignore"):
            value = _value(tree.body, {**_CONSTANTS, **variables})
        result = np.zeros_like(next(iter(variables.values()))) + np.asarray(value, dtype=np.float64)
    except _WrongError as wrong:
        raise SceneError(f"the expression {shown(text)} cannot be used: {wrong}") from None
    except (SyntaxError, ValueError, RecursionError, MemoryError, TypeError) as error:
        raise SceneError(f"the expression {shown(text)} is not valid: {str(error).splitlines()[0]}") from error
    if not np.isfinite(result).all():
        raise SceneError(f"the expression {shown(text)} is not finite everywhere; valid are finite heights")
    return result


class _WrongError(Exception):
    """What an expression may not hold."""


def _value(node: ast.AST, names: Mapping[str, Any]) -> Any:
    match node:
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            return np.float64(number)
        case ast.Name(id=name) if name in names:
            return names[name]
        case ast.UnaryOp(op=op, operand=operand) if type(op) in _OPERATORS:
            return _OPERATORS[type(op)](_value(operand, names))
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
            return _OPERATORS[type(op)](_value(left, names), _value(right, names))
        case ast.Compare(left=left, ops=[op], comparators=[right]) if type(op) in _OPERATORS:
            return _OPERATORS[type(op)](_value(left, names), _value(right, names))
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if name in FUNCTIONS:
            function, count = FUNCTIONS[name]
            if len(arguments) != count:
                raise _WrongError(f"{name} has {len(arguments)} arguments, valid are {count}")
            return function(*[_value(argument, names) for argument in arguments])
    what, valid = shown(ast.unparse(node)), f"numbers, {', '.join(names)}, + - * / % **, and {', '.join(FUNCTIONS)}"
    raise _WrongError(f"{what} is unknown; valid are {valid}")
