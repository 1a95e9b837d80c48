-- :checkhealth gcc-robot
local M = {}

-- Neovim 0.10 renamed the functions of reports.
local health = vim.health or require("health")
local start = health.start or health.report_start
local ok = health.ok or health.report_ok
local warn = health.warn or health.report_warn
local err = health.error or health.report_error
local info = health.info or health.report_info

local function style()
  if vim.lsp.config and vim.lsp.enable then
    return "vim.lsp.config and vim.lsp.enable (0.11 and later)"
  elseif vim.lsp.start then
    return "vim.lsp.start (0.8 and later)"
  end
  return "vim.lsp.start_client (before 0.8)"
end

local function clients()
  local all = vim.lsp.get_clients and vim.lsp.get_clients() or vim.lsp.get_active_clients()
  return vim.tbl_filter(function(c)
    return c.name == "gcc-robot" or c.name == "gcc_robot"
  end, all)
end

local function program()
  local robot = require("gcc-robot")
  local found = require("gcc-robot.program").find(robot.options.program)
  if not found then
    err("the program gcc-robot was not found", {
      "cargo install --path compiler/cli, in a clone of the project",
      'or name it: require("gcc-robot").setup({ program = "/path/to/gcc-robot" })',
    })
    return
  end
  local lines, status = require("gcc-robot.program").run(found, { "--version" })
  if status ~= 0 then
    err(found .. " --version ended with " .. status)
    return
  end
  ok(("%s, %s"):format(lines[1] or "?", vim.fn.exepath(found)))
end

function M.check()
  start("gcc-robot: program")
  program()
  start("gcc-robot: language server")
  if vim.fn.has("nvim-0.7") == 0 then
    err("Neovim 0.7 or later is needed")
    return
  end
  info("started by " .. style())
  if vim.fn.has("nvim-0.10") == 0 then
    info("inlay hints need Neovim 0.10")
  end
  local running = clients()
  if #running == 0 then
    warn("not running", {
      "open a G-code or STEP-NC file",
      'is require("gcc-robot").setup() in your init.lua?',
    })
  end
  for _, client in ipairs(running) do
    ok("running in " .. (client.config.root_dir or "no folder"))
  end
end

return M
