vim.filetype.add({ extension = { ngc = "gcode", nc = "gcode", tap = "gcode", gcode = "gcode" } })
