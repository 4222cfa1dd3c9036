"""Mistakes of what was asked for, told all at once."""

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from tumble._engine import SceneError


class Mistakes:
    """A list that grows, and ends in one error."""

    def __init__(self) -> None:
        self.found: list[dict[str, Any]] = []

    def add(self, place: str, text: str) -> None:
        """`place` is the argument as it was typed."""
        self._once({"path": place, "inner": place, "line": None, "message": text})

    def take(self, error: SceneError, words: Mapping[str, str] | None = None) -> None:
        """The mistakes that an error tells. Those of overrides stand at what `words` has for them: override -> place."""
        for issue in getattr(error, "issues", None) or [{"path": "", "line": None, "message": str(error)}]:
            place = (words or {}).get(issue["set"], f"--set {issue['set']}") if "set" in issue else ""
            path = ": ".join(dict.fromkeys(filter(None, (place, str(issue["path"])))))
            inner = str(issue["path"] or path)
            self._once({"path": path, "inner": inner, "line": issue.get("line"), "message": issue["message"]})

    def _once(self, issue: dict[str, Any]) -> None:
        # A key that is none is so with each of its values.
        if not any(all(issue[k] == other[k] for k in ("inner", "message")) for other in self.found):
            self.found.append(issue)

    @contextmanager
    def gathered(self, words: Mapping[str, str] | None = None) -> Iterator[None]:
        """Takes the SceneError of a block, and goes on after it."""
        try:
            yield
        except SceneError as error:
            self.take(error, words)

    def tell(self) -> None:
        """Raises SceneError, if there are any."""
        if self.found:
            raise _together(self.found)


def _together(issues: Iterable[Mapping[str, Any]]) -> SceneError:
    found = [{key: issue[key] for key in ("path", "line", "message")} for issue in issues]
    error = SceneError("\n".join(": ".join(filter(None, (i["path"], i["message"]))) for i in found))
    error.issues = found
    return error
