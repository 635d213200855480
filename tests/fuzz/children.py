"""Work in a process of its own: placo and Pinocchio keep some MB of every robot that they have read."""

import json
import os
import signal
import sys
import time
import traceback
import warnings


def run_in_child(work, patience: float):
    """What some work returns, as JSON holds it, from a fork that is killed after some seconds.

    Raises:
        AssertionError: The child ended without an answer; the message has its traceback where there is one.
    """
    reading, writing = os.pipe()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of forks beside the threads of libraries, which the child does not use
        child = os.fork()
    if child == 0:
        os.close(reading)
        try:
            said = json.dumps({"answer": work()})
        except BaseException:
            said = json.dumps({"traceback": traceback.format_exc()[-4000:]})
        with os.fdopen(writing, "w") as pipe:
            pipe.write(said)
        sys.stdout.flush()
        os._exit(0)
    os.close(writing)
    said, end = b"", time.monotonic() + patience
    os.set_blocking(reading, False)
    while time.monotonic() < end:
        try:
            part = os.read(reading, 65536)
        except BlockingIOError:
            time.sleep(0.02)
            continue
        if not part:
            break
        said += part
    else:
        os.kill(child, signal.SIGKILL)
    os.close(reading)
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    assert said, f"a child ended with {status} and without an answer"
    found = json.loads(said)
    assert "answer" in found, found["traceback"]
    return found["answer"]
