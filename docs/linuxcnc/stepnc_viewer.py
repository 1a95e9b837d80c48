# The STEP-NC file beside the G-code that AXIS runs: an entry in AXIS's View menu opens it, and the workingstep of the
# line that is running (or selected) is marked. Install it as a user command file, see docs/linuxcnc.md:
#
#     [DISPLAY]
#     USER_COMMAND_FILE = stepnc_viewer.py
#
# With STEPNC_VIEWER = 1 in the same section the window is open from the start.
#
# AXIS runs this file among its own names; of those it uses root_window, widgets, vars, inifile, tempdir, loaded_file.

import bisect as _bisect
import os as _os
import re as _re
import tkinter as _tk


class StepNcViewer:
    """A window with the file that was opened, before the filter made G-code of it."""

    TITLE = "STEP-NC program"
    # The comment that gcc-robot writes in front of each workingstep: (#70 name)
    STEP = _re.compile(r"^\(#(\d+)[ )]")
    ENDINGS = (".p21", ".stp", ".step", ".stpnc")
    PERIOD = 200

    def __init__(self):
        self.window = None
        self.shown = None
        self.marked = None

    def open(self):
        if self.window is None:
            self.build()
        self.window.deiconify()
        self.window.lift()
        self.follow()

    def build(self):
        self.window = _tk.Toplevel(root_window)
        self.window.title(self.TITLE)
        self.window.protocol("WM_DELETE_WINDOW", self.close)
        self.where = _tk.Label(self.window, anchor="w")
        self.where.pack(side="top", fill="x")
        bar = _tk.Scrollbar(self.window)
        bar.pack(side="right", fill="y")
        self.text = _tk.Text(self.window, width=100, height=30, wrap="none", font="TkFixedFont", yscrollcommand=bar.set)
        self.text.pack(side="left", fill="both", expand=True)
        self.text.tag_configure("step", background="#ffe08a")
        bar.configure(command=self.text.yview)
        self.shown = None

    def close(self):
        self.window.destroy()
        self.window = None

    def follow(self):
        """Looks again, as long as the window is open."""
        if self.window is None:
            return
        try:
            self.look()
        except (OSError, _tk.TclError) as fault:
            self.where.configure(text=str(fault))
        root_window.after(self.PERIOD, self.follow)

    def look(self):
        name = loaded_file
        if not name or _os.path.splitext(name)[1].lower() not in self.ENDINGS:
            self.where.configure(text="no STEP-NC program is open")
            return
        code = _os.path.join(tempdir, _os.path.basename(name))
        stamp = (name, _os.path.getmtime(name), _os.path.getmtime(code))
        if stamp != self.shown:
            self.load(name, code)
            self.shown = stamp
        self.mark(self.step_of(self.line()))

    def load(self, name, code):
        with open(name, encoding="utf-8", errors="replace") as file:
            text = file.read()
        self.text.configure(state="normal")
        self.text.delete("1.0", "end")
        self.text.insert("1.0", text)
        self.text.configure(state="disabled")
        self.places = {}
        for found in _re.finditer(r"#(\d+)\s*=[^;]*;", text):
            self.places.setdefault(found.group(1), found.span())
        self.lines, self.steps = [], []
        with open(code, encoding="utf-8", errors="replace") as file:
            for number, line in enumerate(file, 1):
                found = self.STEP.match(line)
                if found:
                    self.lines.append(number)
                    self.steps.append(found.group(1))
        self.marked = None
        self.window.title("%s: %s" % (self.TITLE, _os.path.basename(name)))

    def line(self):
        """The line of G-code that runs, or that is selected."""
        running = vars.running_line.get()
        return running if running > 0 else vars.highlight_line.get()

    def step_of(self, line):
        at = _bisect.bisect_right(self.lines, line)
        return self.steps[at - 1] if at and line > 0 else None

    def mark(self, step):
        if step == self.marked:
            return
        self.marked = step
        self.text.tag_remove("step", "1.0", "end")
        if step is None or step not in self.places:
            self.where.configure(text="no workingstep is running")
            return
        start, end = ("1.0 + %d chars" % n for n in self.places[step])
        self.text.tag_add("step", start, end)
        self.text.see(start)
        self.where.configure(text="workingstep #%s, %d of %d" % (step, self.steps.index(step) + 1, len(self.steps)))


stepnc_viewer = StepNcViewer()
widgets.menu_view.insert_command(0, label="STEP-NC Program", command=stepnc_viewer.open)
widgets.menu_view.insert_separator(1)
if inifile.find("DISPLAY", "STEPNC_VIEWER") == "1":
    root_window.after(1000, stepnc_viewer.open)
