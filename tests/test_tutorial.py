"""The tutorial's files and commands run in their order, as printed, and print what it shows, up to digits."""

import importlib
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).resolve().parent.parent
TUTORIAL = (ROOT / "toolkit" / "TUTORIAL.md").read_text()
QUICK = ("toolkit.surfaces", "toolkit.plan", "toolkit.robots")


class Block(NamedTuple):
    """One fenced block, its language, and the name of a file in the line before, or none."""

    name: str
    language: str
    body: str


BLOCKS = [Block(*found) for found in re.findall(r"(?:^`(\S+)`:\n\n)?^```(\w+)\n(.*?)^```$", TUTORIAL, re.M | re.S)]


def without_digits(text: str) -> list[str]:
    """The words of each line, with # for every number."""
    return [" ".join(re.sub(r"\d[\d.]*(e-?\d+)?", "#", line).split()) for line in text.splitlines()]


def needed(block: Block) -> bool:
    """Whether the ordinary suite runs this block: it has no command that takes long."""
    return all(name in QUICK for name in re.findall(r"python -m ([a-z_.]+)", block.body))


def execute(folder: Path, block: Block) -> str:
    """Run one block, each line in one shell, and give what it printed."""
    printed, setup = "", f'python() {{ "{sys.executable}" "$@"; }}\n'
    known = os.environ | {"PYTHONPATH": str(ROOT), "COLUMNS": "250", "NUMBA_NUM_THREADS": "1"}
    for line in block.body.splitlines():
        done = subprocess.run(["bash", "-c", setup + line], cwd=folder, env=known, capture_output=True, text=True)
        said = re.search(r"# exit code (\d)", line)
        assert done.returncode == (int(said[1]) if said else 0), f"{line}\n{done.stdout}{done.stderr}"
        printed += done.stdout + done.stderr
        setup += line + "\n" if re.match(r"\w+=", line) else ""
    return printed


def follow(folder: Path, wanted) -> None:
    """Go through the tutorial, and run the blocks of commands that are wanted."""
    printed = None
    for block in BLOCKS:
        if block.name:
            (folder / block.name).write_text(block.body)
        elif block.language == "bash":
            printed = execute(folder, block) if wanted(block) else None
        elif block.language == "text" and printed is not None:
            lines = without_digits(printed)
            for line in without_digits(block.body):
                assert line == "..." or line in lines, f"not printed: {line}\n{printed}"


def test_the_quick_part_of_the_tutorial_runs(tmp_path):
    follow(tmp_path, needed)
    assert (tmp_path / "look" / "surfaces.rrd").is_file()
    assert not (tmp_path / "runs").exists()


@pytest.mark.slow
def test_the_whole_tutorial_runs(tmp_path):
    follow(tmp_path, lambda block: True)
    assert (tmp_path / "runs" / "first" / "strip.png").is_file()
    assert (tmp_path / "columns" / "trajectory.npz").is_file()
    assert (tmp_path / "contacts" / "contacts.json").is_file()
    assert (tmp_path / "data" / "motions" / "index.parquet").is_file()


def commands() -> list[str]:
    lines = [line for block in BLOCKS if block.language == "bash" for line in block.body.splitlines()]
    return [line.split("#")[0] for line in lines if "python -m" in line]


@pytest.mark.parametrize("command", commands())
def test_every_option_exists(command, capsys):
    words = command.partition("python -m ")[2].split()
    subcommand = words[1:2] if words[0] == "toolkit.train" else []
    with pytest.raises(SystemExit) as end:
        importlib.import_module(words[0]).main([*subcommand, "--help"])
    assert end.value.code == 0
    known = re.findall(r"--[a-z-]+", capsys.readouterr().out)
    assert {word for word in words if word.startswith("--")} <= set(known)


def test_the_tutorial_is_short_and_names_its_blocks():
    assert len(TUTORIAL.splitlines()) <= 200
    assert {block.language for block in BLOCKS} == {"xml", "bash", "text"}
    assert [block.name for block in BLOCKS if block.language == "xml"] == ["world.xml"]
