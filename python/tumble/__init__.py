"""tumble simulates masses, springs, cloth, ropes and solids for computer animation, and for learning how it is done.

from tumble import Scene, World
world = World(Scene.load("scenes/sheet.toml"))
world.step()
world.frame["sheet"]["position"]
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tumble._engine import (
        ExportError,
        Scene,
        SceneError,
        StepError,
        TumbleError,
        World,
        load_fabric,
        load_mesh,
        repair_mesh,
    )
    from tumble.reader import Run

    __version__: str

__all__ = [
    "ExportError",
    "Run",
    "Scene",
    "SceneError",
    "StepError",
    "TumbleError",
    "World",
    "__version__",
    "load_fabric",
    "load_mesh",
    "repair_mesh",
]

# Looked up when first used: `import tumble` alone loads neither the engine nor NumPy.
_HOMES = {name: ("tumble._engine", name) for name in __all__}
_HOMES["Run"] = ("tumble.reader", "Run")
_HOMES["__version__"] = ("tumble._engine", "version")


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'tumble' has no attribute {name!r}")
    module, attribute = _HOMES[name]
    value = getattr(importlib.import_module(module), attribute)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
