"""`tumble lab contact`: rigid bodies and grains, each experiment beside its exact or measured figure."""

from tumble.lab.contact.cases import CASES, Case
from tumble.lab.contact.report import page

__all__ = ["CASES", "Case", "page"]
