"""The terminal display of a run: a row per stage, progress of the current stage, the checks, the verdict."""

from __future__ import annotations

import sys
import weakref
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import mujoco
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
from toolkit.execution.result import Execution
from toolkit.pipeline.loop import PipelineResult
from toolkit.pipeline.observer import Observer
from toolkit.report.run_report import RunReport
from toolkit.report.summary import sequence_rows
from toolkit.robot.model import RobotModel
from toolkit.world.scene import doubts
from toolkit.world.world import World

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


def print_warnings(console: Console, robot: RobotModel) -> None:
    """Print what is doubtful about a robot, a line each."""
    for warning in robot.warnings:
        _warn(console, robot.name, warning)


def _warn(console: Console, name: str, warning: str) -> None:
    """Print a warning about something with a name."""
    console.print(f"warning: {name}: {warning}", style="yellow", soft_wrap=True, markup=False)


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

    def warn(self, robot: RobotModel, world: World) -> None:
        """Print what is doubtful about a robot, and about it in a world."""
        self._clear()
        print_warnings(self.console, robot)
        for line in doubts(robot, world):
            _warn(self.console, world.name, line)

    def verdict(self, checks: Sequence[Check], passed: bool, reason: str, folder: Path, seconds: float) -> None:
        """Print the checks, then `PASS` or `FAIL: reason` on its own line, then the folder of the run's files.

        The table is left out without checks. `seconds` is the time from the command to the verdict.
        """
        text = "PASS" if passed else f"FAIL: {reason}"
        table = _check_table(checks) if checks else None
        self.conclude(table, text, passed, [f"written to {folder}, {seconds:.1f} s in all"])

    def conclude(self, table: Table | None, verdict: str, passed: bool, lines: Sequence[str]) -> None:
        """Print a table, a verdict on its own line, and what else there is to say."""
        self._clear()
        if table is not None:
            self.console.print(table)
        self._line(Text(" ".join(verdict.split()), style=STYLES[Result.PASS if passed else Result.FAIL]))
        for line in lines:
            self._line(Text(line))

    def _line(self, text: Text) -> None:
        """Print one line, never wrapped."""
        self.console.print(text, soft_wrap=True)

    def _clear(self) -> None:
        """Remove the line of the current stage."""
        if self._task is not None:
            self._progress.remove_task(self._task)
            self._progress.stop()
            self._task = None


def _check_table(checks: Sequence[Check], recorded: Sequence[Check] | None = None) -> Table:
    """A row per check, with its value, limit, unit and result; where given, with the `recorded` value before it."""
    table = Table(box=box.SIMPLE, pad_edge=False)
    table.add_column("check")
    for name in ("value", "limit") if recorded is None else ("recorded", "replayed", "limit"):
        table.add_column(name, justify="right")
    table.add_column("unit")
    table.add_column("result")
    before = {check.name: check.value for check in recorded or ()}
    for check in checks:
        values = [check.value] if recorded is None else [before.get(check.name), check.value]
        words = ["-" if value is None else f"{value:.4g}" for value in values]
        result = Text(check.result.value, style=STYLES[check.result])
        table.add_row(Text(check.name), *words, f"{check.limit:.4g}", check.unit, result)
    return table


def show_replay(
    display: StageConsole, report: RunReport, again: Execution, differs: str, written: Sequence[Path]
) -> None:
    """Print the checks of a replay beside the recorded ones, its verdict, and the files that were written.

    `differs` is one line on how the replay is not the recorded run, or "".
    """
    text, lines = "PASS" if again.failure is None else f"FAIL: {again.failure.reason}", []
    if differs:
        text = f"DIFFERS: {differs}"
        made, here = report.versions.get("mujoco", "unknown"), mujoco.__version__
        if made != here:
            lines.append(f"it was recorded with MuJoCo {made}, this is {here}")
    else:
        lines.append(f"the same states, bit for bit, at {len(again.samples.tick_times)} control ticks and at the end")
    lines += [f"written to {path}" for path in written]
    display.conclude(_check_table(again.checks, report.checks), text, not differs and again.failure is None, lines)


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
