# User command file of AXIS in the tests: the viewer as it is shipped, and beside it a hand that switches the machine on,
# homes it and starts the program, as an operator would with the buttons. state.txt tells the test how far things are.

import os as _os

with open(_os.path.join(_os.path.dirname(inifile.find("DISPLAY", "USER_COMMAND_FILE")), "stepnc_viewer.py")) as _file:
    exec(compile(_file.read(), "stepnc_viewer.py", "exec"))


class Operator:
    """One step at a time, each when the one before is done."""

    def __init__(self):
        self.step = 0
        root_window.after(1500, self.work)

    def work(self):
        s.poll()
        done = self.steps()[self.step]()
        if done:
            self.step += 1
        with open("state.new", "w") as out:
            out.write("%d\n%s\n%s\n%s\n" % (self.step, loaded_file, widgets.menu_view.entrycget(0, "label"), stepnc_viewer.marked))
        _os.replace("state.new", "state.txt")
        if self.step < len(self.steps()):
            root_window.after(200, self.work)

    def steps(self):
        return [self.on, self.home, self.place, self.run, self.running, self.follow]

    def on(self):
        c.state(linuxcnc.STATE_ESTOP_RESET)
        c.wait_complete()
        c.state(linuxcnc.STATE_ON)
        c.wait_complete()
        s.poll()
        return s.task_state == linuxcnc.STATE_ON

    def home(self):
        ensure_mode(linuxcnc.MODE_MANUAL)
        if not all(s.homed[:3]):
            set_motion_teleop(0)
            for joint in range(3):
                c.home(joint)
            return False
        return True

    def place(self):
        """Nobody places windows here: the viewer goes beside the screen."""
        if stepnc_viewer.window is None:
            return False
        root_window.geometry("+0+0")
        stepnc_viewer.window.geometry("+745+0")
        return True

    def run(self):
        commands.task_run()
        return True

    def running(self):
        return vars.running_line.get() > 20

    def follow(self):
        return stepnc_viewer.marked is not None


stepnc_operator = Operator()
