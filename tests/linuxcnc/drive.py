#!/usr/bin/python3
"""Stands where a screen would: switches the machine on, runs the program of OPEN_FILE and records the joints.

Started by LinuxCNC as its DISPLAY. The samples go to samples.txt (one line per millisecond: X Y Z in mm), what went
wrong to standard output; the last line is `done` when the program ran to its end.
"""

import os
import subprocess
import sys
import time

import linuxcnc

status, command, errors = linuxcnc.stat(), linuxcnc.command(), linuxcnc.error_channel()


def wait(reached, seconds):
    end = time.time() + seconds
    while time.time() < end:
        status.poll()
        if reached():
            return True
        time.sleep(0.01)
    return False


def must(what, reached, seconds):
    if not wait(reached, seconds):
        print("never", what, errors.poll(), flush=True)
        sys.exit(1)


def main():
    ini = linuxcnc.ini(os.environ["INI_FILE_NAME"])
    time.sleep(0.5)
    command.state(linuxcnc.STATE_ESTOP_RESET)
    command.wait_complete()
    command.state(linuxcnc.STATE_ON)
    must("on", lambda: status.task_state == linuxcnc.STATE_ON, 60)
    for joint in range(3):
        command.home(joint)
        command.wait_complete()
    must("homed", lambda: all(status.homed[:3]), 60)
    with open("samples.txt", "w") as out:
        sampler = subprocess.Popen(["halsampler"], stdout=out)
        time.sleep(0.3)
        command.mode(linuxcnc.MODE_AUTO)
        command.wait_complete()
        command.program_open(ini.find("DISPLAY", "OPEN_FILE"))
        command.wait_complete()
        command.auto(linuxcnc.AUTO_RUN, 0)
        must("running", lambda: status.interp_state != linuxcnc.INTERP_IDLE, 60)
        must("at the end", lambda: status.interp_state == linuxcnc.INTERP_IDLE and status.inpos, 240)
        time.sleep(0.3)
        sampler.terminate()
        sampler.wait()
    fault = errors.poll()
    print("error %s" % (fault,) if fault else "done", flush=True)


main()
