"""The experiments of `tumble lab contact`, in the order of its page."""

from collections.abc import Callable
from dataclasses import dataclass

from tumble.lab.contact import blows, flows, slopes, statics, tumbling
from tumble.lab.contact.figure import Result


@dataclass(frozen=True)
class Case:
    """An experiment."""

    name: str
    """The word for `--case`."""
    title: str
    run: Callable[[], Result]


CASES = {
    case.name: case
    for case in (
        Case("block", "A block on a slope", slopes.block),
        Case("rolling", "A ball that rolls down a slope", slopes.rolling),
        Case("slipping", "A ball that starts slipping", slopes.slipping),
        Case("cradle", "Newton's cradle", blows.cradle),
        Case("bounce", "A bouncing ball", blows.bounce),
        Case("cards", "A card house", statics.cards),
        Case("arch", "An arch of stones", statics.arch),
        Case("wing-nut", "A wing nut that turns over", tumbling.wing_nut),
        Case("hopper", "A hopper with a flat bottom", flows.hopper),
        Case("column", "A column that collapses", flows.column),
    )
}
"""By name."""
