"""What a run wrote is read back as it was, and a damaged folder is refused in one line that names the file."""

import numpy as np
import pytest

from tests.report.conftest import make_run
from tests.saved.damage import DAMAGES
from toolkit.errors import InputError
from toolkit.report.arrays import write_execution
from toolkit.report.files import digest, write_scene
from toolkit.report.run_report import read_report, write_report
from toolkit.report.saved_run import read_run


@pytest.mark.parametrize("steps", [0, 4])
def test_a_written_run_is_read_back(tmp_path, steps):
    made = make_run(steps)
    execution = made.execution
    write_execution(tmp_path / "execution.npz", execution)
    write_scene(tmp_path / "scene.mjb", execution.scene)
    write_report(tmp_path / "report.json", made.report)
    again = read_run(tmp_path).execution
    assert again is not None
    single = {"com", "com_planned", "momentum", "momentum_planned", "wrench", "wrench_planned"}
    single |= {"limb_pose", "torque_ratio", "cop_margin"}
    for name, value in execution.named().items():
        if name in ("tick_seconds", "real_time_factor", "replan_seconds"):
            assert np.isnan(again.named()[name]).all()
        elif name in single:  # kept in single precision
            np.testing.assert_allclose(again.named()[name], value, rtol=1e-6, atol=1e-7, err_msg=name)
        else:
            np.testing.assert_array_equal(again.named()[name], value, err_msg=name)
    assert repr(again.standard) == repr(execution.standard)
    assert again.scene.nq == execution.scene.nq
    assert again.failure is not None and again.failure.reason == made.report.reason


def test_a_report_is_read_back(tmp_path):
    run = make_run()
    write_report(tmp_path / "report.json", run.report)
    again = read_report(tmp_path / "report.json")
    assert again.checks == run.report.checks  # the one without a finite value included
    assert again.verdict == run.report.verdict and again.seed == run.report.seed
    write_report(tmp_path / "again.json", again)
    assert (tmp_path / "again.json").read_bytes() == (tmp_path / "report.json").read_bytes()


def test_a_run_that_was_not_executed_has_no_execution(planned_folder):
    assert read_run(planned_folder).execution is None


def test_the_scene_is_known_by_its_digest(walk_folder):
    with np.load(walk_folder / "execution.npz") as file:
        assert str(file["scene_digest"]) == digest((walk_folder / "scene.mjb").read_bytes())


@pytest.mark.parametrize(("damage", "words"), DAMAGES.values(), ids=DAMAGES.keys())
def test_a_damaged_folder_is_refused(copy, damage, words):
    damage(copy)
    with pytest.raises(InputError) as error:
        read_run(copy)
    message = str(error.value)
    assert words in message and str(copy) in message and "\n" not in message


def test_what_is_no_folder_is_refused(tmp_path):
    with pytest.raises(InputError, match="no such folder"):
        read_run(tmp_path / "nowhere")
    (tmp_path / "file").write_text("text")
    with pytest.raises(InputError, match="is no folder"):
        read_run(tmp_path / "file")


@pytest.mark.parametrize("seed", range(3))
def test_any_changed_byte_is_found_or_changes_nothing(copy, walk_folder, seed):
    """Archives keep a checksum of each part and the scene has a digest; only what no reader looks at goes through."""
    rng = np.random.default_rng(seed)
    good = read_run(walk_folder).execution
    for name in ("execution.npz", "scene.mjb"):
        whole = (walk_folder / name).read_bytes()
        for _ in range(12):
            content = bytearray(whole)
            content[int(rng.integers(len(content)))] ^= int(rng.integers(1, 256))
            (copy / name).write_bytes(content)
            try:
                found = read_run(copy).execution
            except InputError:
                continue
            np.testing.assert_array_equal(found.controls.ctrl, good.controls.ctrl)
            np.testing.assert_array_equal(found.samples.qpos, good.samples.qpos)
        (copy / name).write_bytes(whole)
