-- Where the gcc-robot program is, and how it is run.
local M = {}

local function runnable(path)
  return path and path ~= "" and vim.fn.executable(path) == 1
end

-- The folder of this plugin; in a clone of the project it lies two levels below the top.
local function plugin_folder()
  local source = debug.getinfo(1, "S").source:sub(2)
  return vim.fn.fnamemodify(source, ":p:h:h:h")
end

--- The program: `wanted`, else the PATH, else where cargo installs and builds. Nil when there is none.
function M.find(wanted)
  if wanted then
    return runnable(wanted) and wanted or nil
  end
  local top = vim.fn.fnamemodify(vim.fn.resolve(plugin_folder()), ":h:h")
  local places = { "gcc-robot", vim.fn.expand("~/.cargo/bin/gcc-robot"), top .. "/target/release/gcc-robot" }
  for _, place in ipairs(places) do
    if runnable(place) then
      return place
    end
  end
  return nil
end

--- Runs the program to its end; returns its output as lines and its exit status.
function M.run(program, arguments)
  local command = { program }
  vim.list_extend(command, arguments)
  local lines = vim.fn.systemlist(command)
  return lines, vim.v.shell_error
end

return M
