"""MuJoCo's warnings end a stage in one line, and neither print nor leave a file."""

import mujoco
import numpy as np
import pytest

from tests.conftest import FLAT
from toolkit import pipeline
from toolkit.errors import InputError, RobotError, ToolkitError, WorldError
from toolkit.mjcf import mujoco_warnings, warnings_refused
from toolkit.pipeline.loop import _Run
from toolkit.report import pictures
from toolkit.robot import loader as robots
from toolkit.world import loader as worlds


def warn(*args, **kwargs):
    """Make MuJoCo warn, as it does of a state that is not finite."""
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><body><freejoint/><geom size='.1'/></body></worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    data.qpos[0] = np.nan
    mujoco.mj_step(model, data)
    return np.zeros((8, 8, 3), np.uint8)


@pytest.fixture(autouse=True)
def nothing_beside(tmp_path, monkeypatch, capfd):
    """Nothing is printed, and nothing is written into the working directory."""
    monkeypatch.chdir(tmp_path)
    yield
    assert not list(tmp_path.iterdir()) and capfd.readouterr() == ("", "")


def test_a_warning_is_an_error_in_one_line():
    with pytest.raises(InputError, match="^it: MuJoCo warns: Nan, Inf or huge value in QPOS") as caught:
        with warnings_refused("it"):
            warn()
    assert "\n" not in str(caught.value)


def test_an_error_comes_before_what_mujoco_warned_of():
    with pytest.raises(ZeroDivisionError), warnings_refused("it"):
        warn()
        raise ZeroDivisionError


def test_warnings_that_are_collected_are_not_refused_around():
    with warnings_refused("it"), mujoco_warnings() as found:
        warn()
    assert len(found) == 1


def test_loading_a_world_refuses_warnings(monkeypatch):
    monkeypatch.setattr(worlds, "_check_walls", warn)
    with pytest.raises(WorldError, match="^flat.xml: MuJoCo warns: "):
        worlds.load_world("flat.xml", mjcf=FLAT.format(friction=0.7, goal=1.0))


def test_loading_a_robot_refuses_warnings(monkeypatch):
    monkeypatch.setattr(robots, "check_agreement", warn)
    with pytest.raises(RobotError, match="MuJoCo warns: "):
        robots.load_robot(None)


def test_a_run_refuses_warnings(monkeypatch, walking):
    monkeypatch.setattr(_Run, "result", warn)
    with pytest.raises(ToolkitError, match="^the run: MuJoCo warns: "):
        pipeline.run(walking.robot, walking.world, None, pipeline.PipelineConfig())


def test_a_picture_is_drawn_all_the_same(monkeypatch, walked, tmp_path_factory):
    monkeypatch.setattr(pictures.OffscreenRenderer, "render", warn)
    path, samples = tmp_path_factory.mktemp("pictures") / "strip.png", walked.samples
    pictures.strip(walked.scene, samples.qpos, samples.tick_times, path, 2)
    assert path.stat().st_size
