"""The layer order of the packages holds, nothing imports in a circle, and the library names no robot."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
LAYERS = [
    "errors",
    "shipped",
    "interruption",
    "processes",
    "drafts",
    "compiled",
    "mjcf",
    "geometry",
    "robot",
    "world",
    "scanning",
    "contacts",
    "physics",
    "centroidal",
    "prediction",
    "search",
    "refine",
    "learning",
    "wholebody",
    "control",
    "replanning",
    "execution",
    "pipeline",
    "report",
    "exchange",
    "clips",
]
WITHIN = {
    "toolkit.search": ["anytime", "states", "moves", "costs"]
}  # packages in their order, then modules beside them
MODULES = sorted((ROOT / "toolkit").rglob("*.py"))


def layer_of(module: str) -> int:
    """Rank of a dotted toolkit module; command lines and anything new at the top level come last."""
    name = module.split(".")[1] if "." in module else ""
    return LAYERS.index(name) if name in LAYERS else len(LAYERS)


def room_of(package: str, module: str) -> int:
    """Rank of a dotted module within its package."""
    rooms, name = WITHIN[package], module.removeprefix(package + ".").split(".")[0]
    return rooms.index(name) if name in rooms else len(rooms)


def module_name(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imported(path: Path, *, top_level_only: bool = False) -> set[str]:
    tree = ast.parse(path.read_text())
    nodes = tree.body if top_level_only else ast.walk(tree)
    names = set()
    for node in nodes:
        if isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module)
            names.update(f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
    return names


@pytest.mark.parametrize("path", MODULES, ids=module_name)
def test_a_module_imports_only_its_own_layer_and_those_above(path):
    here = module_name(path)
    for name in imported(path):
        if name.startswith("toolkit.") and name != "toolkit.cli":
            assert layer_of(name) <= layer_of(here), f"{here} must not import {name}"
        if name.split(".")[0] == "rerun":
            assert here.startswith("toolkit.report"), f"{here} imports rerun; only report may"
        if name.split(".")[0] == "torch":
            assert here.startswith("toolkit.learning") or here == "toolkit.train"


@pytest.mark.parametrize("package", WITHIN)
def test_packages_within_a_package_keep_their_order(package):
    for path in (ROOT / package.replace(".", "/")).rglob("*.py"):
        here = module_name(path)
        for name in imported(path):
            if here != package and name.startswith(package + "."):
                assert room_of(package, name) <= room_of(package, here), f"{here} must not import {name}"


def test_no_import_cycle():
    modules = {module_name(path): path for path in MODULES}
    graph = {name: {i for i in imported(path, top_level_only=True) if i in modules} for name, path in modules.items()}
    done: set[str] = set()

    def visit(name: str, trail: tuple[str, ...]) -> None:
        assert name not in trail, " -> ".join([*trail, name])
        if name not in done:
            for child in graph[name] - {name}:
                visit(child, (*trail, name))
            done.add(name)

    for name in graph:
        visit(name, ())


def test_no_robot_or_world_is_named_in_the_package():
    names = {path.parent.name for path in (ROOT / "robots").glob("*/robot.toml")}
    names |= {path.stem for path in (ROOT / "worlds").glob("*.xml")} - {"flat", "stairs"}  # plain English words
    generators = {"generators", "terrain"}  # kinds of random terrain share their names with shipped worlds
    for path in MODULES:
        if path.stem not in generators:
            text = path.read_text()
            for name in names:
                assert not re.search(rf"\b{re.escape(name)}\b", text), f"{module_name(path)} names {name}"
