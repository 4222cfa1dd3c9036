"""What tests need and not every machine has."""

import os
from typing import NoReturn

import pytest


def missing(what: str) -> NoReturn:
    """Skips a test; fails it under `make test` on Linux with Node, where everything is there."""
    (pytest.fail if os.environ.get("TUMBLE_PREPARED") else pytest.skip)(what)
    raise AssertionError
