-- Neovim 0.11 and later: `vim.lsp.enable("gcc_robot")` finds this.
local robot = require("gcc-robot")
local program = require("gcc-robot.program")

return {
  cmd = { program.find(robot.options.program) or "gcc-robot", "lsp" },
  filetypes = robot.all_filetypes(),
  root_dir = robot.root_dir,
}
