"""The experiments of `tumble lab contact`, in the order of its page."""

from collections.abc import Callable
from dataclasses import dataclass

from tumble.lab.contact import slopes
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
    )
}
"""By name."""
