"""The terminal display of a run: a row per stage, progress of the current stage, the checks, the verdict."""

from __future__ import annotations

import sys
import weakref
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    SpinnerColumn,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Table
from rich.text import Text

from toolkit.errors import InputError
from toolkit.execution.check import Check, Result
from toolkit.pipeline.loop import PipelineResult
from toolkit.pipeline.observer import Observer
from toolkit.report.summary import sequence_rows

STYLES = {Result.PASS: "bold green", Result.FAIL: "bold red", Result.NOT_CHECKED: "yellow"}
PLAIN_WIDTH = 160  # columns assumed where the output is no terminal


class _Console(Console):
    """A console that blames standard output where it takes nothing more, as on a full disk."""

    def print(self, *objects: Any, **options: Any) -> None:
        """Print as rich does.

        Raises:
            InputError: standard output cannot be written.
        """
        try:
            super().print(*objects, **options)
        except BrokenPipeError:
            raise
        except OSError as error:
            raise InputError(f"standard output cannot be written ({error.strerror})") from error


def make_console() -> Console:
    """A console on standard output; plain, uncoloured and wide where that is no terminal."""
    return _Console(width=None if sys.stdout.isatty() else PLAIN_WIDTH, highlight=False)


def progress_bar(console: Console) -> Progress:
    """A progress bar for counted work; it shows nothing where the output is no terminal."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=console,
        disable=not console.is_terminal,
    )


class StageConsole(Observer):
    """Shows a run as it goes.

    On a terminal the current stage has a line with a spinner, a bar where its progress is known, and the time. A stage
    that ended leaves a row. Where the output is no terminal, only the rows are printed.
    """

    def __init__(self, console: Console | None = None):
        """Show on `console`; None for `make_console()`."""
        self.console = make_console() if console is None else console
        self._progress = Progress(
            SpinnerColumn(),
            TextColumn("{task.description}", markup=False),
            BarColumn(bar_width=30),
            TimeElapsedColumn(),
            TextColumn("{task.fields[detail]}", markup=False),
            console=self.console,
            transient=True,
            disable=not self.console.is_terminal,
        )
        self._task: TaskID | None = None
        self._headed = False
        weakref.finalize(self, self._progress.stop)  # shows the cursor again, even after an error

    def started(self, stage: str) -> None:
        """A stage begins: show its line."""
        self._clear()
        if self.console.is_terminal:
            self._progress.start()
            self._task = self._progress.add_task(f"{stage:<10}", total=None, detail="")

    def progress(self, stage: str, fraction: float | None, detail: str = "") -> None:
        """A stage goes on; `fraction` is in [0, 1], or None where it is unknown."""
        if self._task is None:
            return
        if fraction is None:
            self._progress.update(self._task, detail=detail)
        else:
            self._progress.update(self._task, total=1.0, completed=fraction, detail=detail)

    def finished(self, stage: str, passed: bool, seconds: float, detail: str = "") -> None:
        """A stage ended: print its row."""
        self._clear()
        if not self._headed:
            self._line(Text(f"{'stage':<11}{'result':<8}{'time':>9}  ", style="dim"))
            self._headed = True
        result = Result.PASS if passed else Result.FAIL
        row = Text(f"{stage:<11}").append(f"{result.value:<8}", style=STYLES[result]).append(f"{seconds:>7.2f} s  ")
        self._line(row.append(" ".join(detail.split())))

    def verdict(self, checks: Sequence[Check], passed: bool, reason: str, folder: Path, seconds: float) -> None:
        """Print the checks, then `PASS` or `FAIL: reason` on its own line, then the folder of the run's files.

        The table is left out without checks. `seconds` is the time from the command to the verdict.
        """
        self._clear()
        if checks:
            self.console.print(_check_table(checks))
        text = "PASS" if passed else f"FAIL: {' '.join(reason.split())}"
        self._line(Text(text, style=STYLES[Result.PASS if passed else Result.FAIL]))
        self._line(Text(f"written to {folder}, {seconds:.1f} s in all"))

    def _line(self, text: Text) -> None:
        """Print one line, never wrapped."""
        self.console.print(text, soft_wrap=True)

    def _clear(self) -> None:
        """Remove the line of the current stage."""
        if self._task is not None:
            self._progress.remove_task(self._task)
            self._progress.stop()
            self._task = None


def _check_table(checks: Sequence[Check]) -> Table:
    """A row per check, with its value, limit, unit and result."""
    table = Table(box=box.SIMPLE, pad_edge=False)
    table.add_column("check")
    for name in ("value", "limit"):
        table.add_column(name, justify="right")
    table.add_column("unit")
    table.add_column("result")
    for check in checks:
        value = "-" if check.value is None else f"{check.value:.4g}"
        result = Text(check.result.value, style=STYLES[check.result])
        table.add_row(Text(check.name), value, f"{check.limit:.4g}", check.unit, result)
    return table


def sequence_table(result: PipelineResult) -> Table:
    """A row per sequence that was optimised; the chosen one is marked, and of those that failed the reason is told."""
    table = Table(box=box.SIMPLE, pad_edge=False)
    table.add_column("sequence", justify="right")
    table.add_column("found by")
    for name in ("transitions", "with palms", "predicted cost", "true cost"):
        table.add_column(name, justify="right")
    table.add_column("")
    for row in sequence_rows(result):
        table.add_row(*map(Text, row))
    return table
