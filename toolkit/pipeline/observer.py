"""Observer: whoever wants to know how a run goes."""

from __future__ import annotations

from typing import Protocol


class Observer(Protocol):
    """Is told how a run goes, for display; never decides anything."""

    def started(self, stage: str, detail: str = "") -> None:
        """A stage begins."""
        ...

    def progress(self, stage: str, fraction: float | None, detail: str = "") -> None:
        """A stage goes on; `fraction` in [0, 1] where known."""
        ...

    def finished(self, stage: str, passed: bool, seconds: float, detail: str = "") -> None:
        """A stage ended."""
        ...


class SilentObserver:
    """Watches without a word."""

    def started(self, stage: str, detail: str = "") -> None:
        """Ignore."""

    def progress(self, stage: str, fraction: float | None, detail: str = "") -> None:
        """Ignore."""

    def finished(self, stage: str, passed: bool, seconds: float, detail: str = "") -> None:
        """Ignore."""
