"""The observer of a run, for display."""

from __future__ import annotations


class Observer:
    """Is told how a run goes and never decides anything; this one ignores it."""

    def started(self, stage: str) -> None:
        """A stage begins."""

    def progress(self, stage: str, fraction: float | None, detail: str = "") -> None:
        """A stage goes on; `fraction` is in [0, 1], or None where it is unknown."""

    def finished(self, stage: str, passed: bool, seconds: float, detail: str = "") -> None:
        """A stage ended."""
