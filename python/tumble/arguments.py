"""Arguments of public functions that are checked before they are used."""

import operator
from typing import Any

from tumble._engine import SceneError, TumbleError


def wrong(path: str, text: str) -> SceneError:
    """An error at a place of a scene, or of an argument."""
    error = SceneError(f"{path}: {text}" if path else text)
    error.issues = [{"path": path, "line": None, "message": text}]
    return error


def whole(value: Any, name: str, least: int | None = None, error: type[TumbleError] = SceneError) -> int:
    """A whole number, one of Python or of NumPy, of `least` or more. Raises the error, by the name of the argument."""
    expected = f"{name}: {value!r}, expected a whole number{'' if least is None else f' >= {least}'}"
    try:
        number = operator.index(value)
    except TypeError:
        number = None
    if number is not None and (least is None or number >= least):
        return number
    raise wrong(*expected.split(": ", 1)) if error is SceneError else error(expected)
