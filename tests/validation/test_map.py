"""The map: worlds of its families, cells, holes and rates on made-up outcomes, and tiny sweeps."""

import io
import json
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from rich.console import Console

from tests.validation.test_programs import result
from toolkit.errors import InputError
from toolkit.world.loader import load_world
from validation import map as program
from validation import map_worlds, options
from validation.growing import state_of
from validation.jobs import ERROR, Job, PoolOptions, run_jobs
from validation.map_families import FAMILIES, QUICK, SEEDS, Cell, cells_of
from validation.map_picture import draw_map
from validation.map_scale import scaled, world_of
from validation.map_table import hole_table, holes_of, summarise, table, wilson
from validation.map_trial import FAILURES, IMPOSSIBLE, NO_SEQUENCE, PASS, completed, in_short, map_trial
from validation.trial_file import TrialFolder


def made(name, *values, seed=0):
    """A world of a family where its maker has put it."""
    family = FAMILIES[name]
    chosen = {axis.name: value for axis, value in zip(family.axes, values, strict=True)}
    return load_world("made.xml", mjcf=family.maker(np.random.default_rng(seed), **chosen))


def tilt(surface):
    return float(np.degrees(np.arccos(surface.pose.normal[2])))


def ground(world, points):
    """Height of the highest surface for feet at points (n, 2), NaN where there is none."""
    heights = np.array([surface.height(np.asarray(points, float)) for surface in world.surfaces if surface.serves_foot])
    return np.where(np.isnan(heights).all(0), np.nan, np.nanmax(np.nan_to_num(heights, nan=-np.inf), axis=0))


def flat_in_common(*worlds):
    """Each of two worlds with those flat surfaces alone that the other one has, too."""
    flat = [[surface for surface in world.surfaces if not surface.relief.any()] for world in worlds]
    known = [np.array([surface.pose.position for surface in surfaces]) for surfaces in flat]
    return [
        SimpleNamespace(surfaces=[s for s in own if np.abs(s.pose.position - others).max(1).min() < 1e-5])
        for own, others in zip(flat, reversed(known), strict=True)
    ]


def geoms(world, prefix):
    """Centres and half sizes of boxes by the prefix of their names."""
    model = world.mujoco_model
    found = [index for index in range(model.ngeom) if model.geom(index).name.startswith(prefix)]
    return model.geom_pos[found], model.geom_size[found]


@pytest.mark.parametrize("name", FAMILIES)
def test_both_ends_of_every_family_load_anywhere(name):
    family = FAMILIES[name]
    for values in (family.values()[0], family.values()[-1]):
        cell = Cell(name, values, 1)
        world = cell.world()
        assert world.name == cell.name
        assert cell.mjcf() == Cell(name, values, 1).mjcf() != Cell(name, values, 2).mjcf()
        assert (world.timing.shift, world.timing.swing) == map_worlds.TIMING
        friction = values[1] if len(values) == 2 and family.axes[1].name == "friction" else map_worlds.FRICTION
        np.testing.assert_allclose([surface.friction for surface in world.surfaces], friction, rtol=1e-6)
        assert np.linalg.norm(world.start.position[:2]) <= 100.0


@pytest.mark.parametrize("name", FAMILIES)
def test_families_have_enough_values_between_their_ends(name):
    family = FAMILIES[name]
    values = np.array(family.values())
    assert len(np.unique(values, axis=0)) == len(values) >= 20
    ends = np.sort([[axis.easy, axis.hard] for axis in family.axes])
    assert (values >= ends[:, 0] - 1e-4).all()
    assert (values <= ends[:, 1] + 1e-4).all()
    if len(family.axes) == 1:
        hard = [family.hard(each) for each in family.values()]
        assert [first < second for first, second in zip(hard, hard[1:], strict=False)].count(False) <= 1


def test_a_quick_sweep_is_a_part_of_the_whole_one_and_families_take_turns():
    whole = cells_of(list(FAMILIES), quick=False)
    quick = cells_of(list(FAMILIES), quick=True)
    assert len(quick) == QUICK
    assert set(quick) <= set(whole)
    assert [cell.family for cell in quick[: len(FAMILIES)]] == list(FAMILIES)
    assert len({cell.name for cell in whole}) == len(whole) == SEEDS * sum(len(f.values()) for f in FAMILIES.values())
    few = cells_of(["gap", "beam"], quick=True, seeds=10, first=5)
    assert len(few) == 2 * 10 * (QUICK // (2 * 10))
    assert {cell.seed for cell in few} == set(range(5, 15))


def test_a_sweep_shows_the_whole_range_before_it_is_over():
    cells = cells_of(["gap"], quick=False)
    assert [cell.seed for cell in cells] == sorted(cell.seed for cell in cells)
    widths = [cell.values[0] for cell in cells]
    assert widths[:3] == [0.5, 0.05, 0.275]
    assert max(np.diff(sorted(widths[:9]))) < 0.07


def test_a_world_is_moved_as_a_whole():
    text = FAMILIES["stairs_up"].maker(np.random.default_rng(0), height=0.1)
    x, y, yaw = 40.0, -70.0, 2.0
    before, after = load_world("a.xml", mjcf=text), load_world("a.xml", mjcf=map_worlds.moved(text, x, y, yaw))
    turn = np.array([[np.cos(yaw), -np.sin(yaw), 0.0], [np.sin(yaw), np.cos(yaw), 0.0], [0.0, 0.0, 1.0]])
    for one, other in [
        (before.start.position, after.start.position),
        (before.goal.position, after.goal.position),
        *((a.pose.position, b.pose.position) for a, b in zip(before.surfaces, after.surfaces, strict=True)),
    ]:
        np.testing.assert_allclose(turn @ one + [x, y, 0.0], other, atol=1e-5)
    assert after.start.yaw == pytest.approx(before.start.yaw + yaw)


@pytest.mark.parametrize("name", ["slope_down", "mesh_ground", "field_ground", "rubble_corridor"])
def test_worlds_to_scale_are_similar(name):
    """All lengths shrink alike, of boxes, meshes and height fields: points, areas; angles and friction stay."""
    cell, factor = Cell(name, FAMILIES[name].values()[0], 2), 0.7
    one, other = cell.world(), world_of(cell, factor)
    np.testing.assert_allclose(factor * one.goal.position, other.goal.position, atol=1e-6)
    assert other.goal.radius == pytest.approx(factor * one.goal.radius)
    x, y = factor * np.random.default_rng(0).uniform(-0.5, 0.5, (2, 300))
    points = other.goal.position[:2] + np.column_stack([x, y])
    np.testing.assert_allclose(ground(other, points), factor * ground(one, points / factor), atol=1e-4)
    assert np.linalg.norm(other.mujoco_model.geom_friction - one.mujoco_model.geom_friction) == 0.0
    assert world_of(cell, 1.0).mujoco_model.geom_pos.tolist() == one.mujoco_model.geom_pos.tolist()


def test_light_and_pictures_are_scaled_with_the_world():
    light = '<light pos="2 2 2" dir="0 0 -1"/>'
    text = f'<mujoco><statistic center="1 2 3" extent="4"/><worldbody>{light}</worldbody></mujoco>'
    model = mujoco.MjModel.from_xml_string(scaled(text, 0.5))
    assert (model.stat.extent, model.light_pos.tolist(), model.light_dir.tolist()) == (2.0, [[1, 1, 1]], [[0, 0, -1]])


@pytest.mark.parametrize(("name", "angle"), [("slope_down", 12.0), ("slope_up", 20.0), ("slope_across", 15.0)])
def test_slopes_have_their_angle(name, angle):
    world = made(name, angle)
    (slope,) = [surface for surface in world.surfaces if tilt(surface) > 1.0]
    assert tilt(slope) == pytest.approx(angle, abs=1e-3)  # the text of a world has six digits
    rise = world.goal.position[2] - world.start.position[2]
    sign = {"slope_down": -1.0, "slope_up": 1.0, "slope_across": 0.0}[name]
    assert rise == pytest.approx(sign * 3.0 * np.sin(np.radians(angle)), abs=1e-5)


def test_slopes_steeper_than_thirty_degrees_are_short():
    world = made("slope_down", 32.0)
    assert world.start.position[2] == pytest.approx(np.sin(np.radians(32.0)), abs=1e-5)


def test_regular_obstacles_have_the_size_that_is_asked_for():
    steps = [made(name, 0.2) for name in ("step_up", "step_down", "stairs_up", "stairs_down")]
    assert [world.goal.position[2] for world in steps] == pytest.approx([0.2, -0.2, 0.8, -0.8])
    for world in steps:
        np.testing.assert_allclose(ground(world, [world.goal.position[:2]]), world.goal.position[2], atol=1e-6)
    bar, ceiling, beam = made("bar", 0.3), made("ceiling", 1.6), made("beam", 0.2)
    centre, half = geoms(bar, "bar")
    assert centre[0, 2] + half[0, 2] == pytest.approx(0.3)
    assert np.nanmax(ground(bar, [[0.7, 0.0], [0.5, 0.0]])) == pytest.approx(0.0, abs=1e-6)
    centre, half = geoms(ceiling, "ceiling")
    assert centre[0, 2] - half[0, 2] == pytest.approx(1.6)
    assert np.isnan(ground(beam, [[1.0, 0.11], [1.0, 0.09]])).tolist() == [True, False]
    for name, depth in (("door", 0.1), ("slot", 2.0)):
        centre, half = geoms(made(name, 0.7), "wall")
        assert np.abs(centre[:, 1]) - half[:, 1] == pytest.approx([0.35, 0.35])
        assert 2 * half[:, 0] == pytest.approx([depth, depth])
    goal = made("turn", 120.0).goal.position
    assert abs(np.degrees(np.arctan2(goal[1], goal[0]))) == pytest.approx(120.0, abs=1e-3)


def test_stones_are_level_and_as_far_apart_as_asked_for():
    for name, rise in (("stones_level", 0.0), ("stones_uneven", 0.08)):
        stones = [s for s in made(name, 0.2, 0.3).surfaces if s.geom.startswith("stone")]
        assert len(stones) == 15
        assert max(tilt(stone) for stone in stones) < 1e-3
        heights = np.array([stone.pose.position[2] for stone in stones])
        assert np.abs(heights).max() <= rise + 1e-6
        assert (np.ptp(heights) > rise) == (rise > 0.0)
        x = np.unique([round(float(stone.pose.position[0]), 4) for stone in stones])
        np.testing.assert_allclose(np.diff(x), 0.5, atol=1e-3)


@pytest.mark.parametrize("name", ["rubble_field", "rubble_corridor"])
def test_rubble_has_a_walkable_way(name):
    options = {"tilt": 25.0, "friction": 0.35}
    text = FAMILIES[name].maker(np.random.default_rng(4), **options)
    assert map_worlds.has_way(text, 0.35)
    assert max(tilt(s) for s in load_world("a.xml", mjcf=text).surfaces if s.geom.startswith("tile")) > 17.3


def test_a_way_needs_tiles_that_touch():
    tiles = {(0, 0): 0, (1, 1): 0, (2, 0): 0, (0, 1): 40, (1, 0): 40, (2, 1): 40}

    def text():
        boxes = (f'<geom name="tile_{r}_{c}" size="1 1 1" euler="{a} 0 0"/>' for (r, c), a in tiles.items())
        return f"<mujoco><worldbody>{''.join(boxes)}</worldbody></mujoco>"

    assert map_worlds.has_way(text(), 0.5)
    tiles[1, 1] = 25  # the friction angle is 26.6 deg
    assert not map_worlds.has_way(text(), 0.5)
    assert map_worlds.has_way(text(), 0.6)


def test_mesh_and_height_field_are_the_same_ground():
    mesh, field = made("mesh_ground", 0.08, seed=3), made("field_ground", 0.08, seed=3)
    points = np.random.default_rng(0).uniform([-0.4, -0.7], [3.5, 0.7], (500, 2))
    heights = ground(mesh, points)
    same, in_field = (ground(world, points) for world in flat_in_common(mesh, field))
    np.testing.assert_allclose(same, in_field, atol=1e-5)
    assert np.isfinite(same).mean() > 0.7 * np.isfinite(heights).mean()
    followed = ground(field, points)  # where facets are not quite flat, the field's follow its ground
    assert np.isfinite(followed[np.isfinite(heights)]).mean() > 0.99
    both = np.isfinite(heights) & np.isfinite(followed)
    np.testing.assert_allclose(followed[both], heights[both], atol=2e-3)
    assert np.isnan(heights).mean() < 0.4  # seams are too narrow for feet
    assert np.nanmin(heights) > -1e-6
    assert 0.04 < np.nanmax(heights) <= 0.08 + 1e-6
    np.testing.assert_allclose(ground(mesh, [world.position[:2] for world in (mesh.start, mesh.goal)]), 0.0, atol=1e-6)


def record(name, values, seed, outcome, reason=""):
    found = {"name": f"{name}-{values}-{seed}", "family": name, "values": list(values), "seed": seed}
    found |= {"outcome": outcome, "passed": outcome == PASS, "stage": outcome.split()[-1], "reason": reason}
    return found | {"short": in_short(outcome, reason)}


def test_a_hole_is_a_failure_that_something_harder_passes_in_all_seeds():
    gap = FAMILIES["gap"]
    records = [
        record("gap", (0.1,), 0, PASS),
        record("gap", (0.1,), 1, FAILURES["execution"], "slip is 0.03 m, the limit is 0.02"),
        record("gap", (0.2,), 0, IMPOSSIBLE, "x"),
        record("gap", (0.2,), 1, PASS),
        record("gap", (0.3,), 0, PASS),
        record("gap", (0.3,), 1, PASS),
        record("gap", (0.4,), 0, PASS),
        record("gap", (0.4,), 1, NO_SEQUENCE, "y"),
    ]
    assert [(hole.record["values"], hole.harder) for hole in holes_of(gap, records)] == [
        ([0.1], (0.3,)),
        ([0.2], (0.3,)),
    ]
    beam = FAMILIES["beam"]
    assert holes_of(beam, [record("beam", (0.2,), 0, NO_SEQUENCE), record("beam", (0.5,), 0, PASS)]) == []
    assert len(holes_of(beam, [record("beam", (0.5,), 0, NO_SEQUENCE), record("beam", (0.2,), 0, PASS)])) == 1


def test_with_two_parameters_harder_means_in_both():
    rubble = FAMILIES["rubble_field"]
    failed = record("rubble_field", (10.0, 0.5), 0, NO_SEQUENCE)
    for values, is_hole in [((12.0, 0.4), True), ((10.0, 0.4), True), ((12.0, 0.6), False), ((9.0, 0.4), False)]:
        assert bool(holes_of(rubble, [failed, record("rubble_field", values, 0, PASS)])) == is_hole
    slope = FAMILIES["slope_down"]  # a steeper one that is shorter is not harder
    failed = record("slope_down", (29.0,), 0, NO_SEQUENCE)
    assert holes_of(slope, [failed, record("slope_down", (31.0,), 0, PASS)]) == []


def test_the_table_leaves_out_of_the_rate_what_is_impossible():
    low, high = wilson(8, 10)
    assert (low, high) == (pytest.approx(0.4902, abs=1e-4), pytest.approx(0.9433, abs=1e-4))
    assert wilson(0, 0) is None
    records = [record("gap", (0.1 + 0.01 * index,), 0, PASS) for index in range(8)]
    records += [record("gap", (0.05,), 0, FAILURES["execution"], "slip is 0.03 m, the limit is 0.02")]
    records += [
        record("gap", (0.3,), 0, NO_SEQUENCE, "no contact sequence found: the limit of 9 expansions was reached")
    ]
    records += [record("gap", (0.5,), index, IMPOSSIBLE, "too wide") for index in range(5)]
    row = summarise("gap", records)
    assert (row["cells"], row["passed"], row["impossible"], row["no_sequence"]) == (15, 8, 5, 1)
    assert (row["rate"], row["interval"]) == (0.8, (low, high))
    assert [hole["reason"] for hole in row["holes"]] == ["slip"]
    nothing = summarise("bar", [record("bar", (0.2,), 0, IMPOSSIBLE, "z")])
    lines = table([row, nothing]).splitlines()
    assert len({line.count("|") for line in lines}) == 1
    assert "| 80% | 49% to 94% |" in lines[2]
    assert "| - | - |" in lines[3]
    assert lines[4].startswith("| all | - | 16 | 8 | 80% |")
    assert "gap-(0.05,)-0 | 0.1 | slip" in hole_table([row, nothing])
    assert hole_table([nothing]) == "There is none."


def test_reasons_are_short_and_without_numbers():
    assert in_short(PASS, "anything") == ""
    found = "no contact sequence found: the limit of 1000 expansions was reached; a higher one may help; "
    assert in_short(NO_SEQUENCE, f"{found}candidates were rejected for: leg too long 61 %, edge 20 %") == (
        "expansions, leg too long"
    )
    assert in_short(FAILURES["execution"], "the robot fell: it tipped over at 3.2 s").startswith("fell")
    meet = "no whole-body motion: a geom of right_thigh and a geom of left_shin collide at 8.60 s, 4.5 mm deep"
    assert in_short(FAILURES["wholebody"], meet) == "thigh and shin collide"
    wide = "nothing leads to the goal at (1, 2): the ground is interrupted by a gap; bring it closer"
    assert in_short(IMPOSSIBLE, wide) == "the ground is interrupted by a gap"
    long = in_short(FAILURES["wholebody"], "no whole-body motion: " + "word " * 30)
    assert long.endswith(" ...")
    assert len(long) <= 44


def test_pictures_of_one_and_of_two_parameters(tmp_path):
    outcomes = [PASS, *FAILURES.values(), NO_SEQUENCE, IMPOSSIBLE, ERROR]
    for name in ("gap", "rubble_field"):
        values = FAMILIES[name].values()
        records = [record(name, values[i], i % 2, outcome, "a reason") for i, outcome in enumerate(outcomes)]
        draw_map(tmp_path / "map" / f"{name}.png", FAMILIES[name], records)
        assert (tmp_path / "map" / f"{name}.png").read_bytes().startswith(b"\x89PNG")


def good(value):
    return {"passed": True, "value": value}


def interrupted(value):
    raise KeyboardInterrupt


def quiet():
    return Console(file=io.StringIO())


def test_a_sweep_goes_on_where_it_was_stopped(tmp_path):
    here, path = PoolOptions(workers=0), tmp_path / "cells"
    jobs = [Job("a", good, (1,)), Job("b", interrupted, (2,))]
    with pytest.raises(KeyboardInterrupt):
        run_jobs(jobs, TrialFolder(path, {"x": 1}), here, quiet(), "")
    (file,) = path.glob("*/*.json")
    assert json.loads(file.read_text())["value"] == 1
    (file.parent / "b.json").write_text('{"name": "b", "pas')  # no record: the trial runs again
    again = run_jobs(
        [Job("a", interrupted, (1,)), Job("b", good, (2,))], TrialFolder(path, {"x": 1}), here, quiet(), ""
    )
    assert [item["value"] for item in again] == [1, 2]
    assert len(TrialFolder(path, {"x": 1}).records) == 2
    other = TrialFolder(path, {"x": 2})
    assert (other.records, other.others) == ({}, 2)


def settings_of(tmp_path, *arguments):
    parser = options.plain_parser("map", "")
    return options.trial_settings(parser.parse_args(["--out", str(tmp_path), *arguments]))


def test_a_gap_as_wide_as_a_road_is_impossible(tmp_path):
    cell = Cell("gap", (3.0,), 0)
    (found,) = completed([{"name": cell.name, **map_trial(settings_of(tmp_path), cell)}], {cell.name: cell})
    assert (found["outcome"], found["passed"]) == (IMPOSSIBLE, False)
    assert "ground" in found["short"]


def test_an_error_of_the_program_is_an_outcome():
    cell = Cell("gap", (0.1,), 0)
    (found,) = completed(
        [{"name": cell.name, "stage": "error", "passed": False, "reason": "ValueError: 1"}], {cell.name: cell}
    )
    assert (found["outcome"], found["family"], found["short"]) == (ERROR, "gap", "ValueError: #")


def test_a_tiny_sweep_writes_its_results_and_resumes(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(program, "cells_of", lambda names, **_: [Cell("turn", (180.0,), 0)])
    folders = ["--workers", "0", "--out", str(tmp_path / "out"), "--results", str(tmp_path / "results")]
    command = ["--families", "turn", "--expansions", "1", "--planner", "kinematic", *folders]
    assert program.main(command) == 0  # no hole
    (row,) = result(folders, "map")["table"]
    assert (row["cells"], row["no_sequence"]) == (1, 1)
    assert (tmp_path / "results" / "map" / "turn.png").is_file()
    assert load_world(tmp_path / "out" / "worlds" / "turn-180-0.xml").surfaces
    capsys.readouterr()
    assert program.main(command) == 0
    assert "1 of 1 trials known from before" in capsys.readouterr().out


def test_results_grow_on_another_machine(tmp_path, monkeypatch, capsys):
    cells = [Cell("turn", (180.0,), 0)]
    monkeypatch.setattr(program, "cells_of", lambda names, **_: cells)
    results = ["--workers", "0", "--results", str(tmp_path / "results")]
    command = ["--families", "turn", "--expansions", "1", "--planner", "kinematic", *results]
    assert program.main([*command, "--out", str(tmp_path / "one")]) == 0
    file = tmp_path / "results" / "map.json"
    earlier = json.loads(file.read_text())
    assert state_of(settings_of(tmp_path, *command[2:6])) == earlier["trials"][0]["state"]
    earlier["trials"][0]["state"] = "0123 with robot 4567"
    file.write_text(json.dumps(earlier))
    cells.append(Cell("turn", (171.0,), 0))
    capsys.readouterr()
    more = [*command, "--grow", "--out", str(tmp_path / "two")]
    assert program.main([*more, "--minutes", "1e-9"]) == 0
    assert "1 of 2 trials have not been run yet" in capsys.readouterr().out
    assert program.main(more) == 0
    (row,) = result(results, "map")["table"]
    assert row["cells"] == 2
    assert "Trials by the code that made them: 1 0123 with robot 4567, 1 " in capsys.readouterr().out
    with pytest.raises(InputError, match=r"other settings \(planner\)"):
        program.main([*more, "--planner", "quasi-static"])


@pytest.mark.slow
def test_a_straight_walk_passes(tmp_path):
    found = map_trial(settings_of(tmp_path), Cell("turn", (0.0,), 0))
    assert found["outcome"] == PASS
    assert found["transitions"] >= 4
