"""The terminal display: rows where there is no terminal, a live line where there is one, the verdict at the end."""

import io
from pathlib import Path

import pytest
from rich.console import Console

from toolkit.execution.check import Check
from toolkit.report.console import StageConsole

CHECKS = (Check("slip", 0.02, "m", 0.03), Check("upright", 0.0, "", 0.0), Check("friction", 0.0))


def show(**options):
    stream = io.StringIO()
    display = StageConsole(Console(file=stream, width=100, highlight=False, **options))
    display.finished("surfaces", True, 0.1, "4 surfaces")
    display.started("planning")
    display.progress("planning", None, "120 expansions [of many]")
    display.finished("planning", True, 1.25, "2 sequences [a]\nnext line")
    display.started("execution")
    display.progress("execution", 0.5, "3.0 s")
    display.finished("execution", False, 12.0, "it slipped")
    return display, stream


def test_without_a_terminal_only_rows_are_printed():
    display, stream = show()
    display.verdict(CHECKS, False, "slip is\n0.03 m", Path("runs/one"), 14.0)
    lines = [line.rstrip() for line in stream.getvalue().splitlines()]
    assert "\x1b" not in stream.getvalue() and "expansions" not in stream.getvalue()
    assert lines[1:4] == [
        "surfaces   PASS       0.10 s  4 surfaces",
        "planning   PASS       1.25 s  2 sequences [a] next line",
        "execution  FAIL      12.00 s  it slipped",
    ]
    assert lines[-2:] == ["FAIL: slip is 0.03 m", "written to runs/one, 14.0 s in all"]
    table = [line.split() for line in lines]
    assert ["slip", "0.03", "0.02", "m", "FAIL"] in table
    assert ["friction", "-", "0", "NOT_CHECKED"] in table


def test_a_pass_is_a_line_of_its_own_and_long_paths_are_not_broken(tmp_path):
    display, stream = show()
    folder = tmp_path / ("x" * 150)
    display.verdict((), True, "", folder, 61.5)
    lines = stream.getvalue().splitlines()
    assert lines[-2] == "PASS" and lines[-1] == f"written to {folder}, 61.5 s in all"


def test_a_terminal_gets_its_cursor_back():
    display, stream = show(force_terminal=True)
    text = stream.getvalue()
    assert "execution" in text and text.count("\x1b[?25l") == text.count("\x1b[?25h") > 0
    display.started("execution")
    del display
    assert stream.getvalue().endswith("\x1b[?25h") or stream.getvalue().count("\x1b[?25h") > text.count("\x1b[?25h")


@pytest.mark.parametrize("stage", ["wholebody"])
def test_progress_of_a_stage_that_was_not_started_is_ignored(stage):
    display, stream = show()
    before = stream.getvalue()
    display.progress(stage, 0.5)
    assert stream.getvalue() == before
