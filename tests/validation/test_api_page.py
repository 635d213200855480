"""The page of the public names is what the docstrings say."""

import re

import toolkit
from toolkit.execution.result import Samples
from validation.api_page import COMMAND, PAGE, _markdown, main, page


def test_the_page_is_up_to_date():
    assert PAGE.read_text(encoding="utf-8") == page(), f"write it anew: {COMMAND}"


def test_every_public_name_has_its_entry_and_no_class_comes_twice():
    names = re.findall(r"^### `(\w+)`$", page(), re.M)
    assert set(toolkit.__all__) <= set(names) and len(names) == len(set(names))
    assert names[: len(toolkit.__all__)] == sorted(toolkit.__all__, key=str.lower)
    assert {"Execution", "Samples", "ContactSequence", "RobotModel", "World"} <= set(names)


def test_shapes_and_errors_are_told():
    text = page()
    assert "- `qpos, qvel`: (C, nq) and (C, nv)." in text and "(C, nq)" in (Samples.__doc__ or "")
    assert "- `RobotError`: There is no such robot" in text
    assert "load_robot(name: str | None, robots_dir: Path | None = None) -> RobotModel" in text


def test_a_docstring_becomes_lists():
    text = "What it does, 2 * 3.\n\nArgs:\n    a, b: The first\n        two.\n\nReturns:\n    A `<b>`: <c>.\n"
    assert _markdown(text) == (
        "What it does, 2 \\* 3.\n\n*Args*\n\n- `a, b`: The first two.\n\n*Returns*\n\n- A `<b>`: \\<c\\>."
    )


def test_the_page_can_be_written_elsewhere(tmp_path):
    assert main(["--out", str(tmp_path / "api.md")]) == 0
    assert (tmp_path / "api.md").read_text(encoding="utf-8") == page()
