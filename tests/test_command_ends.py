"""A command ends in one line and the right exit code, whatever its standard streams, folders and signals are."""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from toolkit import cli

ROOT = Path(__file__).resolve().parent.parent
PROBE = "from toolkit import cli\nimport os, pathlib, sys, time\ndef main(argv):\n{}\n    return 0\ncli.run(main)\n"
CLOSED = "error: standard output is closed; send it to /dev/null where it is not wanted\n"


def shell(text: str, cwd: Path = ROOT, **environment: str) -> subprocess.CompletedProcess:
    """Run a line of bash in which $PY is Python."""
    known = os.environ | {"PY": sys.executable, "PYTHONPATH": str(ROOT)} | environment
    known.pop("PYTHONUNBUFFERED", None)
    return subprocess.run(["bash", "-c", text], cwd=cwd, env=known, capture_output=True, timeout=120, check=False)


def probe(body: str, redirection: str = "", cwd: Path = ROOT, **environment: str) -> subprocess.CompletedProcess:
    """Run a command of its own whose main function has this body."""
    program = PROBE.format("\n".join("    " + line for line in body.splitlines()))
    return shell(f"$PY -c '{program}' {redirection}", cwd, **environment)


@pytest.mark.parametrize(
    ("redirection", "code", "line"),
    [
        (">&-", 2, CLOSED),
        (">&- <&-", 2, CLOSED),
        (">/dev/full", 2, "error: standard output: No space left on device\n"),
        ("1</dev/null", 2, "error: standard output: Bad file descriptor\n"),
        ("2>&-", 0, ""),
        ("2>/dev/full", 0, ""),
        ("<&-", 0, ""),
    ],
)
@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_standard_streams_that_take_nothing(redirection, code, line, unbuffered):
    done = probe('sys.stdout.write("text\\n")', redirection, PYTHONUNBUFFERED=unbuffered)
    assert (done.returncode, done.stderr.decode()) == (code, line)


def test_help_that_cannot_be_printed_is_noticed():
    done = probe('cli.parser("x", "y").parse_args(["--help"])', ">/dev/full")
    assert (done.returncode, done.stderr) == (2, b"error: standard output: No space left on device\n")
    assert probe('cli.parser("x", "y").parse_args(["--help"])').returncode == 0


def test_a_reader_that_goes_away_is_no_error():
    done = probe('sys.stdout.write("text\\n" * 100_000)', "| head -1; exit ${PIPESTATUS[0]}")
    assert (done.returncode, done.stdout, done.stderr) == (1, b"text\n", b"")


def test_standard_output_of_ascii_alone_takes_any_text():
    done = probe('sys.stdout.write("\\u00f6 \\udcff\\n")', PYTHONIOENCODING="ascii", PYTHONUTF8="0", LC_ALL="C")
    assert (done.returncode, done.stdout, done.stderr) == (0, b"\\xf6 \\udcff\n", b"")


def test_a_console_blames_standard_output_where_it_is_full():
    done = probe("from toolkit.report.console import make_console\nmake_console().print(1)", ">/dev/full")
    assert (done.returncode, done.stderr) == (
        2,
        b"error: standard output cannot be written (No space left on device)\n",
    )


def test_a_working_directory_that_is_gone(tmp_path):
    gone = tmp_path / "gone"
    gone.mkdir()
    done = shell(f"rmdir {gone}; $PY -m toolkit.terrain stairs", gone)
    assert done.returncode == 2
    assert done.stderr == b"error: the working directory no longer exists; change into another one\n"


def test_a_file_that_cannot_be_read_is_one_line():
    done = probe('open("/none\\udcff")')
    assert (done.returncode, done.stderr) == (2, b"error: /none\\udcff: No such file or directory\n")


def test_a_mistake_in_the_options_is_one_line(capsys):
    parser = cli.parser("plan", "Plan.")
    cli.add_planning_options(parser)
    cli.add_robot_options(parser)
    for option, value, message in (
        ("--seed", "-1", "-1: give a whole number from 0 to 2147483647"),
        ("--seed", "9" * 5000, "give a whole number from 0"),
        ("--timing", "100,100", "at most 10 s"),
        ("--timing", "1e9,1e9", "at most 10 s"),
        ("--timing", "0,1", "above zero"),
        ("--expansions", "9" * 20, "the most that is accepted"),
        ("--time-limit", "inf", "not above zero"),
        ("--planner", "a\nb", "invalid choice"),
        ("--robot", "--", "argument --robot: -- is no value"),
        ("--un\nknown", "a", "unrecognized arguments"),
    ):
        with pytest.raises(SystemExit) as left:
            parser.parse_args([f"{option}={value}"])
        line = capsys.readouterr().err
        assert left.value.code == 2 and message in line, line
        assert line.startswith("error: ") and line.endswith("--help\n") and line.count("\n") == 1
    assert parser.parse_args(["--timing", "10,10"]).timing[0].shift == 10.0


RUNNING = """
from toolkit.report.files import RunFolder
with RunFolder(pathlib.Path(sys.argv[1]), "w", "r") as folder:
    (folder.path / "plan.json").write_text("half")
    print("ready", flush=True)
    while True:
        try:
            time.sleep(60)
        except BaseException:
            pass
"""


def started(body: str, *arguments: str) -> subprocess.Popen:
    """Start a command and wait until it prints a line."""
    program = PROBE.format("\n".join("    " + line for line in body.splitlines()))
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    usual = signal.signal(signal.SIGINT, signal.default_int_handler)  # a child inherits that a signal is ignored
    process = subprocess.Popen(
        [sys.executable, "-c", program, *arguments], stdout=-1, stderr=-1, text=True, env=environment
    )
    signal.signal(signal.SIGINT, usual)
    assert process.stdout is not None and process.stdout.readline() == "ready\n"
    return process


@pytest.mark.parametrize(("name", "line"), [("SIGINT", "interrupted\n"), ("SIGTERM", "terminated\n")])
def test_a_signal_leaves_one_line_and_nothing_else(name, line, tmp_path):
    number = getattr(signal, name)
    process = started(RUNNING, str(tmp_path / "a" / "run"))
    assert os.listdir(tmp_path) == ["a"]
    process.send_signal(number)
    process.send_signal(number)  # twice, as from a terminal and from a program that passes it on
    _, err = process.communicate(timeout=20)
    assert (process.returncode, err) == (128 + number, line)
    assert os.listdir(tmp_path) == []


def test_a_signal_waits_for_what_must_not_be_stopped(tmp_path):
    body = """
from toolkit.interruption import undisturbed
with undisturbed():
    print("ready", flush=True)
    time.sleep(0.5)
    pathlib.Path(sys.argv[1]).touch()
time.sleep(60)"""
    process = started(body, str(tmp_path / "done"))
    process.send_signal(signal.SIGTERM)
    _, err = process.communicate(timeout=20)
    assert (process.returncode, err) == (143, "terminated\n") and (tmp_path / "done").exists()


@pytest.mark.parametrize("deaf", ["", "signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGTERM])"])
def test_a_signal_ends_the_processes_that_were_started(deaf):
    body = f"""
import multiprocessing, signal
def work():
    {deaf}
    time.sleep(600)
child = multiprocessing.get_context("fork").Process(target=work)
child.start()
print("ready", flush=True)
print(child.pid, flush=True)
time.sleep(60)"""
    process = started(body)
    assert process.stdout is not None
    child = int(process.stdout.readline())
    process.send_signal(signal.SIGTERM)
    assert process.wait(timeout=20) == 143
    process.communicate(timeout=20)
    with pytest.raises(ProcessLookupError):
        os.kill(child, 0)


COMMANDS = sorted(path.stem for path in (ROOT / "toolkit").glob("*.py") if "cli.run(main)" in path.read_text())


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_imports_little_before_it_minds_signals(name):
    """Until then a signal ends it with a traceback of the import that it met."""
    program = f"import sys, toolkit.{name}\nprint(*sorted({{name.partition('.')[0] for name in sys.modules}}))"
    loaded = shell(f'$PY -c "{program}"').stdout.decode().split()
    assert "toolkit" in loaded
    assert not {"numpy", "scipy", "mujoco", "rich", "numba", "concurrent", "asyncio"} & set(loaded)


def test_an_ignored_signal_stays_ignored():
    body = "import os, signal\nos.kill(os.getpid(), signal.SIGHUP)\nsys.stdout.write(str(1))"
    done = shell(f"trap '' HUP; $PY -c '{PROBE.format(chr(10).join('    ' + line for line in body.splitlines()))}'")
    assert (done.returncode, done.stdout) == (0, b"1")


@pytest.mark.slow
@pytest.mark.parametrize(("name", "line"), [("SIGINT", "interrupted\n"), ("SIGTERM", "terminated\n")])
def test_a_run_is_stopped_at_any_moment(name, line, tmp_path):
    number, rng = getattr(signal, name), random.Random(3)
    command = [sys.executable, "-m", "toolkit.validate", str(ROOT / "worlds" / "flat.xml"), "--out", "run"]
    usual = signal.signal(signal.SIGINT, signal.default_int_handler)
    for _ in range(20):
        process = subprocess.Popen(
            command, cwd=tmp_path, stdout=-1, stderr=-1, text=True, env=os.environ | {"PYTHONPATH": str(ROOT)}
        )
        time.sleep(rng.uniform(0.3, 6.0))
        process.send_signal(number)
        _, err = process.communicate(timeout=60)
        if process.returncode in (0, -number):  # it had ended, or was about to
            assert err == "" and (tmp_path / "run" / "report.json").exists()
        else:
            assert (process.returncode, err) == (128 + number, line)
        assert [path for path in tmp_path.rglob("*") if path.name.endswith(".tmp")] == []
    signal.signal(signal.SIGINT, usual)


@pytest.mark.slow
def test_what_a_killed_run_leaves_is_cleared_by_the_next(tmp_path):
    command = [sys.executable, "-m", "toolkit.validate", str(ROOT / "worlds" / "flat.xml"), "--out", "run"]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    for delay in (3.0, 5.0, 8.0):
        process = subprocess.Popen(command, cwd=tmp_path, stdout=-1, stderr=-1, env=environment)
        time.sleep(delay)
        process.kill()
        process.communicate()
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == 0, done.stderr
    assert os.listdir(tmp_path) == ["run"]
    assert sorted(os.listdir(tmp_path / "run")) == [
        "execution.npz", "motion.npz", "plan.json", "recording.rrd", "report.json", "scene.mjb",
    ]  # fmt: skip
