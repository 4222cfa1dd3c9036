"""Where a building plan holds people up: doors ranked by the time that people lose in their queues.

`study` runs a plan with several seeds, `Findings.rows` is the ranking. See docs/theory/crowds.md.
"""

from tumble.bottlenecks.runs import Findings, Rank, Widened, study

__all__ = ["Findings", "Rank", "Widened", "study"]
