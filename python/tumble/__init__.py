"""tumble simulates masses, springs, cloth, ropes, solids and fluids for computer animation, and for learning how it is done.

>>> import tumble
>>> world = tumble.World(tumble.Scene.load("sheet-on-ball"))
>>> report = world.step()
>>> world.frame["sheet"]["position"].shape
(2401, 3)

A run folder holds the frames, for films, plots and other programs:

>>> run = tumble.simulate(tumble.Scene.load("rope"), "out/rope", frames=3)
>>> run.frame(-1)["rope"]["position"].shape
(61, 3)
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
    from tumble.run import simulate
    from tumble.sweeps.study import sweep

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
    "simulate",
    "sweep",
]

_MODULES = (
    "bottlenecks", "branch", "columns", "compare", "emitters", "expect", "export", "fields", "film", "looks", "measures",
    "pictures", "plots", "reader", "refine", "run", "slices", "sweeps", "usd",
)  # fmt: skip
"""Modules for users."""


# Looked up when first used: `import tumble` alone loads neither the engine nor NumPy.
_HOMES = {name: ("tumble._engine", name) for name in __all__}
_HOMES["Run"] = ("tumble.reader", "Run")
_HOMES["simulate"] = ("tumble.run", "simulate")
_HOMES["sweep"] = ("tumble.sweeps.study", "sweep")
_HOMES["__version__"] = ("tumble._engine", "version")


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        return importlib.import_module(f"tumble.{name}")
    if name not in _HOMES:
        raise AttributeError(f"module 'tumble' has no attribute {name!r}")
    module, attribute = _HOMES[name]
    value = getattr(importlib.import_module(module), attribute)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__, *_MODULES})
