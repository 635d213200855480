"""Writes toolkit/API.md from the docstrings: `python -m validation.api_page`."""

from __future__ import annotations

import argparse
import ast
import inspect
import re
import textwrap
import typing
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import toolkit
from toolkit import cli
from toolkit.drafts import write_whole
from validation.machine import ROOT

PAGE = ROOT / "toolkit" / "API.md"
COMMAND = "python -m validation.api_page"
_SECTION = re.compile(r"^(Args|Attributes|Returns|Yields|Raises):$")
_ENTRY = re.compile(r"^(?P<names>[\w*, .]+): (?P<text>.*)$")
_HEAD = f"""\
# The public names of the package

`from toolkit import ...` gives the names of the first part; the second part holds the classes that they return and are
made of. Units are SI and radians unless a name says otherwise, frames are the world's, and quaternions say their order.
Every error is a `toolkit.errors.ToolkitError`, whose `exit_code` is that of the commands. This page is made from the
docstrings by `{COMMAND}`.
"""


def page() -> str:
    """The whole page."""
    public = {name: getattr(toolkit, name) for name in sorted(toolkit.__all__, key=str.lower)}
    others = sorted(_others(list(public.values())), key=lambda item: item.__name__.lower())
    parts = [_HEAD, "## Names of `toolkit`", *(_entry(item) for item in public.values())]
    parts += ["## What they take and return", *(_entry(item) for item in others)]
    return "\n\n".join(part.strip() for part in parts) + "\n"


def _others(public: list[Any]) -> set[type]:
    """Classes of the package that public functions return, those that public classes hold, and what these hold."""
    found: set[type] = set()
    left = [kind for item in public for kind in _mentioned(item)]
    while left:
        kind = left.pop()
        if kind not in found:
            found.add(kind)
            left += _mentioned(kind)
    return found - set(public)


def _mentioned(item: Any) -> Iterator[type]:
    """Classes of the package in the annotations of a class's fields, or of what a function returns."""
    hints = typing.get_type_hints(item)
    for hint in hints.values() if inspect.isclass(item) else [hints["return"]]:
        for kind in (hint, *typing.get_args(hint)):
            if inspect.isclass(kind) and kind.__module__.startswith("toolkit.") and inspect.getdoc(kind):
                yield kind


def _entry(item: Any) -> str:
    """A class or a function: its heading, how it is called, and its docstring; of a class, what else it offers too."""
    node = ast.parse(textwrap.dedent(inspect.getsource(item))).body[0]
    lines = [f"### `{item.__name__}`", f"`{item.__module__}`"]
    if isinstance(node, ast.ClassDef):
        lines += [_block(_construction(node)), _text(item), _text(item.__init__) if _documented(node) else ""]
        members = [_member(part) for part in node.body if isinstance(part, ast.FunctionDef)]
        lines += ["*Properties and methods*" if any(members) else "", *members]
    elif isinstance(node, ast.FunctionDef):
        lines += [_block(_call(node, node.name)), _text(item)]
    return "\n\n".join(line for line in lines if line)


def _member(node: ast.FunctionDef) -> str:
    """A public method or property of a class; "" for what is private."""
    if node.name.startswith("_"):
        return ""
    marks = {mark.id for mark in node.decorator_list if isinstance(mark, ast.Name)}
    is_value = bool(marks & {"property", "cached_property"})
    returns = f" -> {ast.unparse(node.returns)}" if node.returns else ""
    shown = f"{node.name}{returns}" if is_value else _call(node, node.name, skip=int("staticmethod" not in marks))
    shown = " ".join(shown.split()).replace("( ", "(").replace(", )", ")")
    return f"- `{shown}`\n" + textwrap.indent(_markdown(ast.get_docstring(node) or ""), "  ")


def _documented(node: ast.ClassDef) -> bool:
    """Whether a class has an `__init__` that says what its arguments are."""
    made = [part for part in node.body if isinstance(part, ast.FunctionDef) and part.name == "__init__"]
    return any(ast.get_docstring(part) for part in made)


def _construction(node: ast.ClassDef) -> str:
    """How an object of a class is made: its `__init__`, or the fields of a dataclass; "" where there is neither."""
    for part in node.body:
        if isinstance(part, ast.FunctionDef) and part.name == "__init__":
            return _call(part, node.name, skip=1).partition(" -> ")[0]
    fields = [part for part in node.body if isinstance(part, ast.AnnAssign) and isinstance(part.target, ast.Name)]
    return _joined(node.name, [_field(part) for part in fields]) if fields else ""


def _field(part: ast.AnnAssign) -> str:
    """A field of a dataclass with its default."""
    text = f"{ast.unparse(part.target)}: {ast.unparse(part.annotation)}"
    if part.value is None:
        return text
    value = ast.unparse(part.value)
    factory = re.search(r"default_factory=(lambda: )?(.*?)\)?$", value) if value.startswith("field(") else None
    if value.startswith("field(") and factory is None:
        return text
    return f"{text} = {value if factory is None else factory[2] + ('' if factory[1] else '()')}"


def _call(node: ast.FunctionDef, name: str, skip: int = 0) -> str:
    """How a function is called; `skip` leaves out its first arguments."""
    arguments = node.args
    given = [*arguments.posonlyargs, *arguments.args]
    defaults = [None] * (len(given) - len(arguments.defaults)) + list(arguments.defaults)
    words = [_argument(each, default) for each, default in zip(given, defaults, strict=True)][skip:]
    if arguments.vararg or arguments.kwonlyargs:
        words.append(f"*{arguments.vararg.arg}" if arguments.vararg else "*")
    words += [_argument(each, value) for each, value in zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True)]
    return _joined(name, words) + (f" -> {ast.unparse(node.returns)}" if node.returns else "")


def _argument(argument: ast.arg, default: ast.expr | None) -> str:
    """An argument with its type and its default."""
    text = argument.arg + (f": {ast.unparse(argument.annotation)}" if argument.annotation else "")
    return text if default is None else f"{text} = {ast.unparse(default)}"


def _joined(name: str, words: list[str]) -> str:
    """A call on one line where it is short, else a line for each argument."""
    line = f"{name}({', '.join(words)})"
    return line if len(line) <= 100 else f"{name}(\n" + "".join(f"    {word},\n" for word in words) + ")"


def _block(code: str) -> str:
    """Code in Markdown, "" of nothing."""
    return f"```python\n{code}\n```" if code else ""


def _text(item: Any) -> str:
    """The docstring of a thing as Markdown."""
    return _markdown(inspect.getdoc(item) or "")


def _markdown(text: str) -> str:
    """A docstring in Google's style as Markdown: its sections become lists."""
    lines, section = [], ""
    for line in text.splitlines():
        heading = _SECTION.match(line)
        if heading:
            section = heading[1]
            lines += [f"*{section}*", ""]
        elif section and line.startswith("    ") and not line.startswith("        "):
            entry = _ENTRY.match(line.strip()) if section not in ("Returns", "Yields") else None
            words = f"`{entry['names']}`: {_plain(entry['text'])}" if entry else _plain(line.strip())
            lines.append(f"- {words}")
        elif section and line.strip():
            lines[-1] += f" {_plain(line.strip())}"
        else:
            lines.append(_plain(line))
    return "\n".join(lines).strip()


def _plain(text: str) -> str:
    """Text in which Markdown finds no marks but backticks."""
    return re.sub(r"(`[^`]*`)|([*<>])", lambda found: found[1] or f"\\{found[2]}", text)


def main(argv: list[str] | None = None) -> int:
    """Write the page; returns the exit code."""
    parser = argparse.ArgumentParser(prog=COMMAND, description=__doc__)
    parser.add_argument("--out", type=Path, default=PAGE, help="the page (default: toolkit/API.md)")
    args = parser.parse_args(argv)
    write_whole(args.out, page().encode())
    return 0


if __name__ == "__main__":
    cli.run(main)
