"""Runs command lines, each in a fork of a process that has imported everything: a hundred times faster than anew.

Reads a line of JSON for each, `{"module", "arguments", "folder", "limit"}`, and answers with the exit code, or null
where the limit in seconds was passed. Standard output and error go into the files `out` and `err` beside the folder.
"""

import importlib
import json
import os
import resource
import signal
import sys
import time

PRELOADED = (
    "toolkit.cli toolkit.pipeline toolkit.report.run toolkit.report.recording toolkit.report.surfaces "
    "toolkit.report.console toolkit.report.top_view toolkit.robot.loader toolkit.robot.picture toolkit.world.loader "
    "toolkit.world.generators toolkit.prediction.optimiser toolkit.search.quasi_static toolkit.report.saved_run "
    "toolkit.report.comparison toolkit.report.health toolkit.report.replay_recording toolkit.report.scan "
    "toolkit.exchange.folder toolkit.exchange.frames toolkit.scanning.building toolkit.scanning.files "
    "toolkit.scanning.world toolkit.execution.replay"
).split()

MOST_MEMORY = 12 * 2**30  # bytes of a command's address space; one that wants more is at fault


def child(request: dict) -> None:
    """Run one command line as `python -m` does; does not return."""
    os.setpgid(0, 0)
    resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
    os.chdir(request["folder"])
    for descriptor, name in ((1, "out"), (2, "err")):
        opened = os.open(f"{request['folder']}/../{name}", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(opened, descriptor)
        os.close(opened)
    module = importlib.import_module(request["module"])
    sys.argv = [module.__file__ or "", *request["arguments"]]
    from toolkit import cli

    code = 1
    try:
        cli.run(module.main)
    except SystemExit as left:
        code = left.code if isinstance(left.code, int) else 1
    except BaseException:
        import traceback

        traceback.print_exc()
    sys.stdout.flush()
    os._exit(code)


def serve() -> None:
    """Answer until the input ends."""
    for name in PRELOADED:
        importlib.import_module(name)
    answers = os.fdopen(os.dup(1), "w")
    for line in sys.stdin:
        request = json.loads(line)
        process = os.fork()
        if process == 0:
            child(request)
        end, code = time.monotonic() + request["limit"], None
        while code is None and time.monotonic() < end:
            done, status = os.waitpid(process, os.WNOHANG)
            if done:
                code = os.waitstatus_to_exitcode(status)
            else:
                time.sleep(0.005)
        if code is None:
            os.killpg(process, signal.SIGKILL)
            os.waitpid(process, 0)
        answers.write(json.dumps(code) + "\n")
        answers.flush()


if __name__ == "__main__":
    serve()
