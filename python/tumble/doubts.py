"""What the books of a run are doubtful about; docs/warnings.md lists the codes."""

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tumble.run import Run

_COURANT = 2.0
"""Cells that a fluid passes in a step, over what was asked for, that are worth telling."""


def of_books(run: "Run") -> list[dict[str, str]]:
    """Code, path and message of each doubt."""
    return [{"code": code, "path": "", "message": message} for code, message in (*_unconverged(run), *_too_fast(run))]


def _unconverged(run: "Run") -> Iterator[tuple[str, str]]:
    """Steps of Newton's method that were given up."""
    if unconverged := int(run.ledger["unconverged"].sum()):
        worst = float(run.ledger["residual"].max())
        yield (
            "unconverged",
            f"{unconverged} of {int(run.ledger['steps'].sum())} steps stopped before Newton's method converged, at a residual "
            f"of up to {worst:.1e} of the first: raise solver.newton_iterations, or take a smaller step",
        )


def _too_fast(run: "Run") -> Iterator[tuple[str, str]]:
    """Steps that were given and let a fluid pass far more cells than its Courant number."""
    given = any(s["method"] == "gas" and (s.get("substeps") or s.get("step")) for s in run.scene["system"])
    asked = max((float(gas["courant"]) for gas in run.scene.get("gas", [])), default=math.inf)
    reached = float(run.ledger["courant"].max())
    if given and reached > _COURANT * asked:
        yield (
            "courant",
            f"the fluid passed up to {reached:.3g} cells in a step, courant is {asked:.3g}: such steps smear; take more "
            "substeps, or leave substeps and step out",
        )
