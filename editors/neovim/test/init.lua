-- The configuration of the tests: what the documentation says for a plain init.lua.
local here = vim.fn.fnamemodify(debug.getinfo(1, "S").source:sub(2), ":p:h:h")
vim.opt.runtimepath:prepend(here)
vim.cmd("filetype plugin indent on | syntax on")
vim.o.swapfile = false
vim.o.hidden = true
require("gcc-robot").setup({ program = vim.env.GCC_ROBOT_BIN })
