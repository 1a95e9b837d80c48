#!/usr/bin/python3
"""Stands where a screen would: runs every program of the folder `programs` and counts the servo cycles of its motion.

Started by LinuxCNC as its DISPLAY. times.txt gets a line per program, `name cycles`, from the first cycle in which a
joint moves to the last; the last line of standard output is `done`.
"""

import glob
import os
import subprocess
import sys
import time

import linuxcnc

# A program does not stand still for so many cycles; before its start the machine does.
STANDSTILL = 150

status, command, errors = linuxcnc.stat(), linuxcnc.command(), linuxcnc.error_channel()


def must(what, reached, seconds):
    end = time.time() + seconds
    while time.time() < end:
        status.poll()
        if reached():
            return
        time.sleep(0.01)
    print("never", what, errors.poll(), flush=True)
    sys.exit(1)


def cycles(name):
    """Cycles of the last motion, by the numbers that the sampler gives them. Before it the way back to zero may be seen."""
    first = last = before = None
    with open(name) as samples:
        for line in samples:
            words = line.split()
            if len(words) != 4:
                continue
            number, here = int(words[0]), tuple(map(float, words[1:]))
            if before is not None and here != before:
                if first is None or number - last > STANDSTILL:
                    first = number
                last = number
            before = here
    return 0 if first is None else last - first + 1


def run(program):
    command.mode(linuxcnc.MODE_MDI)
    command.wait_complete()
    command.mdi("G90 G21 G17 G94 G61 G0 X0 Y0 Z0")
    command.wait_complete(20)
    must("at zero", lambda: status.inpos and max(map(abs, status.position[:3])) < 1e-6, 20)
    command.mode(linuxcnc.MODE_AUTO)
    command.wait_complete()
    command.program_open(program)
    command.wait_complete()
    with open("samples.txt", "w") as out:
        sampler = subprocess.Popen(["halsampler", "-t"], stdout=out)
        time.sleep(0.4)
        command.auto(linuxcnc.AUTO_RUN, 0)
        must("running " + program, lambda: status.interp_state != linuxcnc.INTERP_IDLE, 10)
        must("at the end of " + program, lambda: status.interp_state == linuxcnc.INTERP_IDLE and status.inpos, 90)
        time.sleep(0.2)
        sampler.terminate()
        sampler.wait()
    return cycles("samples.txt")


def main():
    time.sleep(0.5)
    command.state(linuxcnc.STATE_ESTOP_RESET)
    command.wait_complete()
    command.state(linuxcnc.STATE_ON)
    must("on", lambda: status.task_state == linuxcnc.STATE_ON, 10)
    for joint in range(3):
        command.home(joint)
        command.wait_complete()
    must("homed", lambda: all(status.homed[:3]), 10)
    with open("times.txt", "w") as out:
        for program in sorted(glob.glob("programs/*.ngc")):
            out.write("%s %d\n" % (os.path.basename(program)[:-4], run(os.path.abspath(program))))
            out.flush()
    fault = errors.poll()
    print("error %s" % (fault,) if fault else "done", flush=True)


main()
