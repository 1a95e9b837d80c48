#!/usr/bin/python3
"""What LinuxCNC 2.9 makes of a program, in full double precision and with source lines.

Uses the `gcode` module of the Debian package linuxcnc-uspace (the one AXIS draws its preview with), so it needs the
system's Python, not another one. Each line of output is `LINE NAME VALUE...`; lengths are millimeters, angles degrees.
The last line is `end CODE LINE TEXT`: code 1 after M2/M30, 3 at the end by %, 5 and more after an error.

    HOME=$(mktemp -d) /usr/bin/python3 canon_full.py PROGRAM [TOOL_TABLE_IN_MM]

The private HOME is needed: version 2.9 keeps the tool table in a file there.
"""

import ctypes
import re
import sys
import tempfile

INCH = 25.4
AXES = "XYZABCUVW"
LINEAR = (0, 1, 2, 6, 7, 8)


def load_tools(path):
    """Creates the shared tool table (without it any T or H word crashes) and reads the file twice: for the
    library, and for the callback that hands out single tools."""
    library = ctypes.CDLL("libtooldata.so.0")
    library._Z17tool_mmap_creatorPK13EMC_TOOL_STATi(None, 0)
    rows = {0: (0,) + (0.0,) * 12 + (0,)}
    if path is None:
        return rows
    library._Z13tooldata_loadPKcPPc(path.encode(), None)
    with open(path) as table:
        lines = [line.split(";")[0] for line in table]
    for index, line in enumerate((l for l in lines if re.match(r"\s*T", l, re.I)), 1):
        words = {k.upper(): float(v) for k, v in re.findall(r"([A-Za-z])\s*([-+]?[0-9.]+)", line)}
        rows[index] = (
            int(words["T"]),
            *(words.get(axis, 0.0) for axis in AXES),
            words.get("D", 0.0),
            words.get("I", 0.0),
            words.get("J", 0.0),
            int(words.get("Q", 0)),
        )
    return rows


class Recorder:
    """Receives the canonical calls; the module counts lengths in inches."""

    def __init__(self, parameters, tools):
        self.parameter_file = parameters
        self.tools = tools
        self.line = 0

    def put(self, name, *values):
        print(self.line, name, *(repr(v) if isinstance(v, float) else v for v in values))

    def next_line(self, state):
        self.line = state.sequence_number

    def pose(self, name, values):
        values = list(values) + [0.0] * (9 - len(values))
        self.put(name, *(v * INCH if i in LINEAR else v for i, v in enumerate(values)))

    def straight_traverse(self, *values):
        self.pose("rapid", values)

    def straight_feed(self, *values):
        self.pose("feed", values)

    def straight_probe(self, *values):
        self.pose("probe", values)

    def rigid_tap(self, x, y, z):
        self.put("tap", x * INCH, y * INCH, z * INCH)

    def arc_feed(self, first_end, second_end, first, second, turns, axis_end, *rest):
        ends = [v * INCH for v in (first_end, second_end, first, second)]
        others = [v * INCH if i >= 3 else v for i, v in enumerate(rest)]
        self.put("arc", *ends, turns, axis_end * INCH, *others)

    def set_g5x_offset(self, index, *values):
        self.put("system", index)
        self.pose("origin", values)

    def set_g92_offset(self, *values):
        self.pose("shift", values)

    def set_xy_rotation(self, angle):
        self.put("rotation", angle)

    def tool_offset(self, *values):
        self.pose("length", values)

    use_tool_offset = tool_offset

    def set_plane(self, plane):
        self.put("plane", plane)

    def set_feed_rate(self, feed):
        self.put("F", feed * INCH)

    def dwell(self, seconds):
        self.put("dwell", seconds)

    def change_tool(self, index):
        self.tools[0] = self.tools.get(index, self.tools[0])
        self.put("tool", index)

    def comment(self, text):
        self.put("comment", text)

    def message(self, text):
        self.put("message", text)

    def user_defined_function(self, number, p, q):
        self.put("M", number, p, q)

    def get_external_angular_units(self):
        return 1.0

    def get_external_length_units(self):
        return 1.0

    def get_axis_mask(self):
        return 0x3F

    def get_block_delete(self):
        return False

    def check_abort(self):
        return False

    def get_tool(self, index):
        return self.tools.get(index, (-1,) + (0.0,) * 12 + (0,))

    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        return lambda *values: self.put(name, *values)


def main():
    tools = load_tools(sys.argv[2] if len(sys.argv) > 2 else None)
    import gcode

    with tempfile.NamedTemporaryFile(suffix=".var") as parameters:
        code, line = gcode.parse(sys.argv[1], Recorder(parameters.name, tools), "G21", "")
    print("end", code, line, gcode.strerror(code) if code > gcode.MIN_ERROR else "ok")


if __name__ == "__main__":
    main()
