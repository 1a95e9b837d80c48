-- Language server, commands and preview for G-code and STEP-NC.
local M = {}

local program = require("gcc-robot.program")

local kinds = require("gcc-robot.filetype")

M.filetypes = { "gcode", "p21" }
-- Of these only the files that `kinds.is_beside` knows.
M.beside = { "toml", "dosini", "tooltable", "cncparameters" }
M.root_markers = { "gcc-robot.toml", ".git" }

M.options = {
  -- The program; nil: on the PATH, then where cargo puts it.
  program = nil,
  -- Handed to the server as settings; see docs/editors.md.
  settings = {},
  -- Called with (client, buffer) when the server is ready: the place for key maps.
  on_attach = nil,
  -- Opens the address of a preview; nil: the system's browser.
  open = nil,
}

local function complain(text)
  vim.notify("gcc-robot: " .. text, vim.log.levels.ERROR)
end

--- The program, or nil after a message that says what to do.
function M.program()
  local found = program.find(M.options.program)
  if not found then
    complain("the program was not found. Build it with `cargo install --path compiler/cli`, or name it: "
      .. 'require("gcc-robot").setup({ program = "/path/to/gcc-robot" })')
  end
  return found
end

--- The folder with the nearest root marker above a file, else the file's own folder.
function M.root(path)
  local folder = vim.fn.fnamemodify(path, ":p:h")
  -- In a list of folders a blank or a comma parts two, and `;` means upwards.
  local upwards = folder:gsub("([ ,;\\])", "\\%1") .. ";"
  for _, marker in ipairs(M.root_markers) do
    local found = vim.fn.findfile(marker, upwards)
    if found == "" then
      found = vim.fn.finddir(marker, upwards)
    end
    if found ~= "" then
      return vim.fn.fnamemodify(found, ":p:h" .. (vim.fn.isdirectory(found) == 1 and ":h" or ""))
    end
  end
  return folder
end

--- Every file type that may be one of the server's.
function M.all_filetypes()
  return vim.list_extend(vim.list_extend({}, M.filetypes), M.beside)
end

--- Whether the server is for this buffer.
function M.is_ours(buffer)
  if vim.tbl_contains(M.filetypes, vim.bo[buffer].filetype) then
    return true
  end
  return kinds.is_beside(vim.api.nvim_buf_get_name(buffer), vim.api.nvim_buf_get_lines(buffer, 0, 2000, false))
end

--- For Neovim 0.11: calls back with the root when the server is for this buffer.
function M.root_dir(buffer, on_root)
  if M.is_ours(buffer) then
    on_root(M.root(vim.api.nvim_buf_get_name(buffer)))
  end
end

-- Neovim 0.10 and later asks for diagnostics itself; sent ones too would be shown twice.
local function init_options()
  return { gccRobot = M.options.settings, pullDiagnostics = vim.fn.has("nvim-0.10") == 1, explainPages = true }
end

--- What Neovim is told of the server, in the form of `vim.lsp.start_client`.
function M.config(root)
  local found = M.program()
  if not found then
    return nil
  end
  return {
    name = "gcc-robot",
    cmd = { found, "lsp" },
    root_dir = root,
    settings = { gccRobot = M.options.settings },
    init_options = init_options(),
    on_attach = M.options.on_attach,
  }
end

-- Before Neovim 0.8 there is no vim.lsp.start: one client per root, kept here.
local clients = {}

local function attach_old(buffer, root)
  local id = clients[root]
  if not (id and vim.lsp.get_client_by_id(id)) then
    local config = M.config(root)
    if not config then
      return
    end
    id = vim.lsp.start_client(config)
    clients[root] = id
  end
  vim.lsp.buf_attach_client(buffer, id)
end

local function attach(buffer)
  local name = vim.api.nvim_buf_get_name(buffer)
  if name == "" or vim.bo[buffer].buftype ~= "" or not M.is_ours(buffer) then
    return
  end
  local root = M.root(name)
  if not vim.lsp.start then
    attach_old(buffer, root)
    return
  end
  local config = M.config(root)
  if config then
    vim.lsp.start(config, { bufnr = buffer })
  end
end

-- From 0.11 on the configuration is found by its name in lsp/gcc_robot.lua.
local function enable_by_name()
  local found = M.program()
  if not found then
    return
  end
  vim.lsp.config("gcc_robot", {
    cmd = { found, "lsp" },
    settings = { gccRobot = M.options.settings },
    init_options = init_options(),
    on_attach = M.options.on_attach,
  })
  vim.lsp.enable("gcc_robot")
end

local function enable_by_event()
  local group = vim.api.nvim_create_augroup("GccRobot", { clear = true })
  vim.api.nvim_create_autocmd("FileType", {
    group = group,
    pattern = M.all_filetypes(),
    callback = function(event)
      attach(event.buf)
    end,
  })
  for _, buffer in ipairs(vim.api.nvim_list_bufs()) do
    if vim.tbl_contains(M.all_filetypes(), vim.bo[buffer].filetype) then
      attach(buffer)
    end
  end
end

-- Names of STEP-NC entities lead to pages of this address, which `gcc-robot explain` writes.
local function show_pages()
  local group = vim.api.nvim_create_augroup("GccRobotPages", { clear = true })
  vim.api.nvim_create_autocmd("BufReadCmd", {
    group = group,
    pattern = "gcc-robot-explain:/*",
    callback = function(event)
      local found = M.program()
      local name = event.match:match("([^/]+)%.md$")
      if not (found and name) then
        return
      end
      local lines = program.run(found, { "explain", name })
      vim.api.nvim_buf_set_lines(event.buf, 0, -1, false, lines)
      vim.bo[event.buf].buftype = "nofile"
      vim.bo[event.buf].modifiable = false
      vim.bo[event.buf].filetype = "markdown"
    end,
  })
end

--- Starts the server for every G-code and STEP-NC buffer, and for the files that programs are run with. Options: see M.options.
function M.setup(options)
  M.options = vim.tbl_extend("force", M.options, options or {})
  show_pages()
  if vim.lsp.config and vim.lsp.enable then
    enable_by_name()
  else
    enable_by_event()
  end
end

return M
