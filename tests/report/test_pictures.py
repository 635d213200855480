"""Pictures show something, and a machine that cannot render says what to install."""

import os
import subprocess
import sys
from dataclasses import replace

import imageio.v3 as iio
import imageio_ffmpeg
import mujoco
import numpy as np
import pytest

from toolkit.errors import InputError
from toolkit.report.offscreen import OffscreenRenderer, Patches, require_rendering, working_backend
from toolkit.report.pictures import follow, strip, video
from toolkit.report.plots import draw_plots
from toolkit.report.top_view import draw_top_view


@pytest.fixture(scope="module")
def rendering():
    try:
        require_rendering()
    except InputError as error:
        pytest.skip(str(error))


def is_drawn(picture):
    colors = picture[..., :3].astype(int) @ [1, 256, 65536]
    return picture.std() > 5 and len(np.unique(colors)) > 20


def patches(run):
    return Patches(run.plan.sequence.start.contacts, run.plan.robot.half_sizes)


def test_the_strip_shows_the_robot_moving(run, tmp_path, rendering):
    scene, samples = run.execution.scene, run.execution.samples
    path = tmp_path / "strip.png"
    strip(scene, samples.qpos, samples.tick_times, path, 3, size=(120, 160), patches=patches(run))
    picture = iio.imread(path)
    assert picture.shape == (160, 360, 3)
    first, middle, last = np.split(picture, 3, axis=1)
    assert all(is_drawn(part) for part in (first, middle, last)) and not np.array_equal(first, last)


def test_contact_patches_are_drawn_in_the_limb_s_colour(run, rendering):
    execution = run.execution
    camera = follow(execution.scene, execution.samples.qpos, execution.samples.tick_times)[0]
    away = execution.samples.qpos[0] + np.eye(1, execution.scene.nq)[0] * 50  # the robot out of the picture
    with OffscreenRenderer(execution.scene, 160, 120) as renderer:
        plain = renderer.render(away, camera)
        marked = renderer.render(away, camera, patches=patches(run))
    changed = np.abs(marked.astype(int) - plain).sum(-1) > 30
    red, green, _ = marked[changed].astype(int).T
    assert (red > green + 30).any() and (green > red + 30).any()


def test_the_video_plays(run, tmp_path, rendering):
    execution = run.execution
    path = tmp_path / "video.mp4"
    times = execution.samples.tick_times[execution.samples.tick_times < 0.5]
    video(execution.scene, execution.samples.qpos[: len(times)], times, path, fps=10, size=(64, 48))
    decode = [imageio_ffmpeg.get_ffmpeg_exe(), "-i", path, "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    run_of_it = subprocess.run(decode, capture_output=True, check=True)
    pictures = np.frombuffer(run_of_it.stdout, np.uint8).reshape(-1, 48, 64, 3)
    assert b"10 fps" in run_of_it.stderr and len(pictures) == 5
    assert all(is_drawn(picture) for picture in pictures)


def test_the_model_is_not_changed_by_rendering_it_large(run, rendering):
    before = run.execution.scene.vis.global_.offwidth
    with OffscreenRenderer(run.execution.scene, 1300, 16) as renderer:
        renderer.render(run.execution.samples.qpos[0], mujoco.MjvCamera())
    assert run.execution.scene.vis.global_.offwidth == before


def test_the_next_backend_takes_over_where_one_fails(rendering):
    first = working_backend()
    assert working_backend(("no_such_backend", first)) == first


def test_osmesa_renders_where_egl_does_not(rendering):
    code = """
import mujoco
from toolkit.report.offscreen import OffscreenRenderer
model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><light pos='0 0 3'/><geom size='1'/></worldbody></mujoco>")
with OffscreenRenderer(model, 32, 32) as renderer:
    assert renderer.render(model.qpos0, mujoco.MjvCamera()).std() > 5
"""
    environment = {name: value for name, value in os.environ.items() if name not in ("MUJOCO_GL", "PYOPENGL_PLATFORM")}
    environment["__EGL_VENDOR_LIBRARY_DIRS"] = "/nonexistent"
    outcome = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True)
    if "osmesa" in outcome.stderr and "cannot render off screen" in outcome.stderr:
        pytest.skip("no OSMesa library here")
    assert outcome.returncode == 0, outcome.stderr


def test_a_machine_that_cannot_render_says_what_to_install():
    with pytest.raises(InputError, match="apt-get install -y libegl1 .* or leave pictures and video out"):
        working_backend(("no_such_backend",))


def test_the_camera_avoids_a_wall(run):
    scene_of = "<mujoco><worldbody>{}<body><freejoint/><geom size='0.1'/></body></worldbody></mujoco>"
    wall = "<geom type='box' size='3 0.05 3' pos='0 {} 1'/>"
    qpos = np.zeros((20, 7))
    qpos[:, 0], qpos[:, 3] = np.linspace(-1, 1, 20), 1.0
    times = np.linspace(0, 2, 20)
    sides = []
    for y in (1.0, -1.0):
        scene = mujoco.MjModel.from_xml_string(scene_of.format(wall.format(y)))
        view = follow(scene, qpos, times)[0]
        sides.append(-np.sin(np.radians(view.azimuth)))  # y of the camera from the robot
    assert sides[0] < 0 < sides[1]


def test_the_plan_from_above_is_drawn_with_whatever_there_is(run, tmp_path):
    infeasible = replace(run.plan, motion=replace(run.plan.motion, feasible=False))
    bare = replace(infeasible, world=replace(run.plan.world, surfaces=()))
    com = run.execution.samples.com
    for plan, executed in ((run.plan, com), (infeasible, com), (bare, None)):
        draw_top_view(tmp_path / "plan.png", plan, run.solution, executed)
        assert is_drawn(iio.imread(tmp_path / "plan.png"))


def test_the_curves_are_drawn(run, tmp_path):
    draw_plots(tmp_path / "plots.png", run.execution, run.plan.schedule)
    assert is_drawn(iio.imread(tmp_path / "plots.png"))
    samples = run.execution.samples
    empty = {name: getattr(samples, name)[:0] for name in ("tick_times", "com", "com_planned", "torque_ratio")}
    short = replace(run.execution, samples=replace(samples, **empty), slip=())
    draw_plots(tmp_path / "empty.png", short, run.plan.schedule)
