"""Data sets of motions: whatever stops one, the same command goes on to the same clips."""

import json
from concurrent.futures import Executor, Future

import numpy as np
import pyarrow.parquet
import pytest

from toolkit.clips import collect as module
from toolkit.clips.attempt import ATTEMPTS, CLIPS, RUNS, ClipConfig, name_of, read_records, remove_attempt
from toolkit.clips.collect import PATIENCE, collect, manifest_of, so_far
from toolkit.clips.index import INDEX, write_index
from toolkit.clips.statistics import page, statistics
from toolkit.clips.terrain import KINDS, random_world
from toolkit.dataset import main
from toolkit.errors import DatasetError, PlanningError
from toolkit.report.files import REPORT, write_json
from toolkit.robot.loader import load_robot
from toolkit.world.loader import load_world

HOURS = 100.0 / 3600.0
FIGURES = ("distance", "speed", "top_speed", "max_slip", "max_scuff", "max_torque_ratio", "max_velocity_ratio")
FIGURES += ("com_rms_error", "final_goal_distance", "fps")


def quick_attempt(config, index, folder):
    """A record of random numbers instead of a run, and the files that show that there is a clip."""
    rng = np.random.default_rng([config.seed, index])
    kind, passed = config.kinds[index % len(config.kinds)], bool(rng.random() < 0.7)
    record = {"attempt": index, "kind": kind, "options": {"x": 1.0}, "seed": index, "passed": passed, "seconds": 2.0}
    record |= {"processor_seconds": 1.0}
    record |= {"stage": "done" if passed else "execution", "reason": "" if passed else f"slip is 0.0{index}"}
    if passed:
        record |= {"duration": float(rng.uniform(5.0, 15.0)), "frames": 500, "transitions": 6}
        record |= {"contacts": 6, "palm_contacts": index % 2, **{name: float(rng.random()) for name in FIGURES}}
        for place in (CLIPS, RUNS):
            path = module.Path(folder) / place / name_of(index)
            path.mkdir(parents=True, exist_ok=True)
            write_json(path / REPORT, {"number": index})
    (module.Path(folder) / ATTEMPTS).mkdir(exist_ok=True)
    write_json(module.Path(folder) / ATTEMPTS / f"{name_of(index)}.json", record)
    return record


class Inline(Executor):
    """Does the work when it is handed in, holds the results of some jobs back, and fails at the one with a number."""

    def __init__(self, fail_at=None, late=()):
        self.jobs, self.fail_at, self.late, self.held = 0, fail_at, late, []

    def submit(self, fn, /, *args, **kwargs):
        future = Future()
        self.jobs += 1
        if self.jobs == self.fail_at:
            future.set_exception(KeyboardInterrupt())
        elif self.jobs in self.late:
            self.held.append((future, fn, args))
        else:
            future.set_result(fn(*args, **kwargs))
            for waiting, work, given in self.held:
                waiting.set_result(work(*given))
            self.held = []
        return future


@pytest.fixture(scope="module")
def robot():
    return load_robot(None)


@pytest.fixture
def config(robot, monkeypatch):
    monkeypatch.setattr(module, "attempt", quick_attempt)
    return ClipConfig(robot.name, str(robot.folder.parent), ("flat", "stairs"), seed=2)


def contents(folder):
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def test_a_data_set_ends_with_the_attempt_that_makes_it_long_enough(tmp_path, robot, config):
    states = []
    records = collect(tmp_path, robot, config, HOURS, Inline(), states.append, ahead=1)
    lengths = [record.get("duration", 0.0) for record in records]
    assert sum(lengths) >= 100.0 > sum(lengths[:-1])
    assert [record["attempt"] for record in records] == list(range(len(records)))
    kept = {name_of(record["attempt"]) for record in records if record["passed"]}
    assert {path.name for path in (tmp_path / CLIPS).iterdir()} == kept < {name_of(i) for i in range(len(records))}
    assert [state.attempts for state in states] == list(range(len(records) + 1))
    assert states[0].last is None and states[-1].clips == len(kept) and states[-1].seconds == sum(lengths)
    assert (tmp_path / "robot" / "robot.xml").is_file()


@pytest.mark.parametrize("fail_at", [1, 2, 4, 7])
def test_an_interrupted_data_set_goes_on_to_the_same_one(tmp_path, robot, config, fail_at):
    whole, halting = tmp_path / "whole", tmp_path / "halting"
    records = collect(whole, robot, config, HOURS, Inline(), ahead=1)
    with pytest.raises(KeyboardInterrupt):
        collect(halting, robot, config, HOURS, Inline(fail_at=fail_at), ahead=1)
    stray = halting / RUNS / name_of(0)
    stray.mkdir(parents=True, exist_ok=True)  # of a worker that was killed before it wrote the record
    again = Inline()
    assert collect(halting, robot, config, HOURS, again, ahead=1) == records
    assert again.jobs == len(records) - (fail_at - 1)  # nothing is made twice
    assert contents(halting) == contents(whole)


@pytest.mark.parametrize("late", [(1,), (2, 5), (6, 7)])
def test_many_workers_make_the_same_data_set_in_any_order(tmp_path, robot, config, late):
    records = collect(tmp_path / "one", robot, config, HOURS, Inline(), ahead=1)
    assert collect(tmp_path / "many", robot, config, HOURS, Inline(late=late), ahead=4) == records
    assert contents(tmp_path / "many") == contents(tmp_path / "one")  # what is too much is removed


def test_what_there_is_can_be_listed_before_the_end(tmp_path, robot, config):
    with pytest.raises(DatasetError, match="no data set here.*make one with: python -m toolkit.dataset"):
        main(["--so-far", "--no-sheet", "--out", str(tmp_path / "none")])
    with pytest.raises(KeyboardInterrupt):
        collect(tmp_path, robot, config, HOURS, Inline(fail_at=6, late=(3,)), ahead=8)
    remove_attempt(tmp_path, 3)
    before = contents(tmp_path)
    assert [record["attempt"] for record in so_far(tmp_path)] == [0, 1, 2]
    assert main(["--so-far", "--no-sheet", "--out", str(tmp_path)]) == 0
    assert before.items() <= contents(tmp_path).items()
    rows = pyarrow.parquet.read_table(tmp_path / INDEX).to_pylist()
    assert [row["attempt"] for row in rows] == [r["attempt"] for r in so_far(tmp_path) if r["passed"]]
    # Such a data set goes on.
    assert collect(tmp_path, robot, config, HOURS, Inline(), ahead=1)[:3] == so_far(tmp_path)[:3]


def test_a_longer_data_set_continues_a_shorter_one_and_not_the_other_way(tmp_path, robot, config):
    first = collect(tmp_path / "a", robot, config, HOURS, Inline(), ahead=1)
    more = Inline()
    longer = collect(tmp_path / "a", robot, config, 2 * HOURS, more, ahead=1)
    assert longer[: len(first)] == first and more.jobs == len(longer) - len(first)
    collect(tmp_path / "b", robot, config, 2 * HOURS, Inline(), ahead=1)
    assert contents(tmp_path / "a") == contents(tmp_path / "b")
    with pytest.raises(DatasetError, match="begun with --hours 0.0555556, now 0.0277778; give at least as many"):
        collect(tmp_path / "a", robot, config, HOURS, Inline(), ahead=1)


def test_a_clip_or_a_record_that_is_lost_is_made_again(tmp_path, robot, config):
    records = collect(tmp_path, robot, config, HOURS, Inline(), ahead=1)
    before, kept = contents(tmp_path), [record["attempt"] for record in records if record["passed"]]
    (tmp_path / CLIPS / name_of(kept[0]) / REPORT).unlink()
    (tmp_path / ATTEMPTS / f"{name_of(kept[1])}.json").write_text("{")
    assert set(read_records(tmp_path)) == set(range(len(records))) - set(kept[:2])
    again = Inline()
    collect(tmp_path, robot, config, HOURS, again, ahead=1)
    assert again.jobs == 2 and contents(tmp_path) == before


def test_runs_may_be_removed(tmp_path, robot, config):
    records = collect(tmp_path, robot, config, HOURS, Inline(), ahead=1)
    for path in (tmp_path / RUNS).iterdir():
        (path / REPORT).unlink()
        path.rmdir()
    again = Inline()
    assert collect(tmp_path, robot, config, HOURS, again, ahead=1) == records and again.jobs == 0


def test_other_settings_other_robots_and_other_folders_are_refused(tmp_path, robot, config):
    collect(tmp_path / "data", robot, config, HOURS, Inline(), ahead=1)
    changed = ClipConfig(config.robot, config.robots, ("flat",), seed=2)
    with pytest.raises(DatasetError, match="begun with other settings.*'kinds': \\['flat', 'stairs'\\]"):
        collect(tmp_path / "data", robot, changed, HOURS, Inline(), ahead=1)
    (tmp_path / "letter.txt").write_text("not a data set")
    with pytest.raises(DatasetError, match="not empty and not a data set"):
        collect(tmp_path, robot, config, HOURS, Inline(), ahead=1)


def test_a_collection_gives_up_where_nothing_passes(tmp_path, robot, config, monkeypatch):
    def failing(config, index, folder):
        return quick_attempt(config, index, folder) | {"passed": False, "reason": "the robot fell"}

    monkeypatch.setattr(module, "attempt", failing)
    executor = Inline()
    with pytest.raises(PlanningError, match=f"none of the last {PATIENCE} worlds passed, the last one for: the robot"):
        collect(tmp_path, robot, config, HOURS, executor, ahead=1)
    assert executor.jobs == PATIENCE


def test_index_and_statistics_tell_of_every_clip(tmp_path, robot, config):
    records = collect(tmp_path, robot, config, HOURS, Inline(), ahead=1)
    write_index(tmp_path, robot.name, records)
    rows, kept = pyarrow.parquet.read_table(tmp_path / INDEX).to_pylist(), [r for r in records if r["passed"]]
    assert [row["clip"] for row in rows] == [f"{CLIPS}/{name_of(record['attempt'])}" for record in kept]
    for row, record in zip(rows, kept, strict=True):
        assert (tmp_path / row["clip"] / REPORT).is_file() and (tmp_path / row["run"] / REPORT).is_file()
        assert json.loads(row["options"]) == record["options"] and row["robot"] == robot.name
        assert {name: row[name] for name in ("kind", "seed", "duration", "contacts", "max_slip")} == {
            name: record[name] for name in ("kind", "seed", "duration", "contacts", "max_slip")
        }
    figures = statistics(records)
    assert figures["hours"] == pytest.approx(sum(record["duration"] for record in kept) / 3600.0)
    assert figures["passed"] == len(kept) / len(records) < 1.0
    assert figures["work"]["wall_hours"] == pytest.approx(2.0 * len(records) / 3600.0)
    assert figures["spread"]["max_slip"]["largest"] == max(record["max_slip"] for record in kept)
    assert sum(row["clips"] for row in figures["kinds"].values()) == len(kept)
    assert [(row["times"], row["reason"]) for row in figures["failures"]] == [(len(records) - len(kept), "slip is #")]
    text = page(figures, manifest_of(tmp_path))
    assert f"in {len(kept)} clips" in text and "| stairs |" in text and "slip is #" in text
    assert statistics([])["spread"]["speed"] == {} and page(statistics([]), manifest_of(tmp_path))


@pytest.mark.parametrize("kind", KINDS)
def test_random_worlds_can_be_used_and_depend_on_the_generator_alone(kind):
    text, options = random_world(kind, np.random.default_rng([3, 1]))
    assert random_world(kind, np.random.default_rng([3, 1])) == (text, options)
    assert random_world(kind, np.random.default_rng([3, 2]))[0] != text
    world = load_world(f"{kind}.xml", mjcf=text)
    assert any(surface.serves_foot for surface in world.surfaces)
    assert options["friction"] == pytest.approx(world.surfaces[0].friction)
    assert (world.timing.shift, world.timing.swing) == pytest.approx((options["shift"], options["swing"]))


def test_what_leads_up_leads_down_too():
    rng = np.random.default_rng(0)
    for kind in ("stairs", "slope"):
        values = [random_world(kind, rng)[1][KINDS[kind].mirrored] for _ in range(20)]
        assert min(values) < 0.0 < max(values)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--kinds", "flat,stares"], "'stares' is no kind of worlds; choose from flat,"),
        (["--kinds", ""], "'' is no kind of worlds"),
        (["--hours", "0"], "0 is not above zero"),
        (["--to", "bvh"], "invalid choice: 'bvh'"),
        (["--workers", "0"], "0 is not above zero"),
    ],
)
def test_bad_options_are_one_line(words, message, tmp_path, capsys):
    with pytest.raises(SystemExit) as end:
        main([*words, "--out", str(tmp_path / "data")])
    line = capsys.readouterr().err
    assert end.value.code == 2 and message in line and line.count("\n") == 1
    assert not (tmp_path / "data").exists()


def test_the_help_teaches(capsys):
    with pytest.raises(SystemExit):
        main(["--help"])
    text = capsys.readouterr().out
    assert "python -m toolkit.dataset --robot" in text and all(kind in text for kind in KINDS)
