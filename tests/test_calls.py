"""Calls of pools end whenever the thread that waits for them is interrupted."""

from processes import python

# Interrupts at every line of what hands calls over and waits for them, one after the other.
EVERY_LINE = """
import faulthandler
import signal
import sys
import time

from paraflex.campaign.workers import open_engine, outcomes

PLACES = ("threading.py", "thread.py", "_base.py", "workers.py", "interrupts.py")


def work(task, watch):
    time.sleep(2e-4)
    watch(0.0)
    return task


def is_interrupted_at(point):
    passed = 0

    def trace(frame, event, _):
        nonlocal passed
        if not frame.f_code.co_filename.endswith(PLACES):
            return None
        if event == "line":
            passed += 1
            if passed == point:
                signal.raise_signal(signal.SIGINT)
        return trace

    # A wait without an end.
    faulthandler.dump_traceback_later(60.0, exit=True)
    try:
        with open_engine("threads", 2) as engine:
            sys.settrace(trace)
            try:
                done = [result for _, result in outcomes(engine, work, range(5))]
            finally:
                sys.settrace(None)
    except KeyboardInterrupt:
        return True
    assert sorted(done) == list(range(5))
    return False


point = 1
while is_interrupted_at(point):
    point += 1
print(point)
"""


def test_an_interrupt_at_any_line_ends_the_calls():
    done = python("-c", EVERY_LINE)
    assert done.returncode == 0, done.stderr
    # Of handing over, and of waiting.
    assert int(done.stdout) > 200
