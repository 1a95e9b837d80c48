-- What the commands do.
local M = {}

local robot = require("gcc-robot")
local program = require("gcc-robot.program")
local settings = require("gcc-robot.settings")

--- Targets for completion on the command line.
function M.targets(lead)
  local found = program.find(robot.options.program)
  if not found then
    return {}
  end
  local names = {}
  for _, line in ipairs((program.run(found, { "target", "list" }))) do
    local name = line:match("^%s*([%w%-]+)%s%s")
    if name and vim.startswith(name, lead or "") then
      table.insert(names, name)
    end
  end
  return names
end

local function saved_name()
  local name = vim.api.nvim_buf_get_name(0)
  if name == "" then
    vim.notify("gcc-robot: this buffer has no file", vim.log.levels.ERROR)
    return nil
  end
  if vim.bo.modified then
    vim.cmd("silent write")
  end
  return name
end

local errorformat = "%f:%l:%c: %trror[%.%#]: %m,%f:%l:%c: %tarning[%.%#]: %m,%f:%l:%c: %tint[%.%#]: %m,%-G%.%#"

--- Builds the file for a target (first argument; the rest goes to `gcc-robot build`). Findings go to the
--- quickfix list. Without -o the result lies beside the source.
function M.build(arguments)
  local found, name = robot.program(), saved_name()
  if not (found and name) then
    return
  end
  local command = { "--message-format", "short", "build", name, "--target", arguments[1] }
  -- What is named here comes last.
  vim.list_extend(command, settings.options(0, arguments))
  vim.list_extend(command, arguments, 2)
  if not vim.tbl_contains(arguments, "-o") and not vim.tbl_contains(arguments, "--output") then
    vim.list_extend(command, { "-o", vim.fn.fnamemodify(name, ":h") .. "/build/" })
    vim.fn.mkdir(vim.fn.fnamemodify(name, ":h") .. "/build", "p")
  end
  local lines, status = program.run(found, command)
  vim.fn.setqflist({}, " ", { title = "gcc-robot build", lines = lines, efm = errorformat })
  if #vim.fn.getqflist() > 0 then
    vim.cmd("copen")
  end
  if status == 0 then
    vim.api.nvim_echo({ { "built for " .. arguments[1] } }, true, {})
  else
    vim.notify(table.concat(lines, "\n"), vim.log.levels.ERROR)
  end
end

-- `decimals=3` on the command line is the option {decimals = 3} of the request.
local function options_of(arguments)
  local options = vim.empty_dict()
  for i = 2, #arguments do
    local key, value = arguments[i]:match("^%-*([%w%-]+)=?(.*)$")
    if key then
      options[key] = value == "" and true or tonumber(value) or value
    end
  end
  return options
end

local function decode_base64(text)
  if vim.base64 then
    return vim.base64.decode(text)
  end
  local alphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/"
  local digit = {}
  for i = 1, 64 do
    digit[alphabet:byte(i)] = i - 1
  end
  local out, bits, held = {}, 0, 0
  for i = 1, #text do
    local d = digit[text:byte(i)]
    if d then
      bits, held = bits * 64 + d, held + 6
      if held >= 8 then
        held = held - 8
        local byte = math.floor(bits / 2 ^ held)
        bits = bits - byte * 2 ^ held
        table.insert(out, string.char(byte))
      end
    end
  end
  return table.concat(out)
end

--- Little-endian u32 numbers in base64, as the requests of our own send them.
function M.integers(text)
  local bytes, out = decode_base64(text), {}
  for i = 1, #bytes - 3, 4 do
    local a, b, c, d = bytes:byte(i, i + 3)
    table.insert(out, a + b * 256 + c * 65536 + d * 16777216)
  end
  return out
end

local none = 4294967295

-- The line of the other window that belongs to the line of this one.
local function follow(source, scratch, lines)
  local group = vim.api.nvim_create_augroup("GccRobotOutput" .. scratch, { clear = true })
  local first = {}
  for i, line in ipairs(lines) do
    if line ~= none and not first[line] then
      first[line] = i
    end
  end
  local function show(buffer, line)
    local window = vim.fn.bufwinid(buffer)
    if window ~= -1 and line then
      local last = vim.api.nvim_buf_line_count(buffer)
      vim.api.nvim_win_set_cursor(window, { math.max(1, math.min(line, last)), 0 })
    end
  end
  vim.api.nvim_create_autocmd("CursorMoved", { group = group, buffer = source, callback = function()
    show(scratch, first[vim.api.nvim_win_get_cursor(0)[1] - 1])
  end })
  vim.api.nvim_create_autocmd("CursorMoved", { group = group, buffer = scratch, callback = function()
    local line = lines[vim.api.nvim_win_get_cursor(0)[1]]
    show(source, line ~= none and line and line + 1 or nil)
  end })
  vim.api.nvim_create_autocmd("BufUnload", { group = group, buffer = scratch, callback = function()
    pcall(vim.api.nvim_del_augroup_by_name, "GccRobotOutput" .. scratch)
  end })
end

local function scratch_for(target)
  local name = "gcc-robot://" .. target
  local scratch = vim.fn.bufnr(name)
  if scratch == -1 then
    scratch = vim.api.nvim_create_buf(false, true)
    vim.api.nvim_buf_set_name(scratch, name)
  end
  if vim.fn.bufwinid(scratch) == -1 then
    local here = vim.api.nvim_get_current_win()
    vim.cmd("vertical sbuffer " .. scratch)
    vim.api.nvim_set_current_win(here)
  end
  return scratch
end

local function show_output(source, target, output)
  if output.error and output.error ~= vim.NIL then
    vim.notify("gcc-robot: " .. output.error, vim.log.levels.ERROR)
    return
  end
  local file = output.files[1]
  if not file then
    vim.notify("gcc-robot: errors keep " .. target .. " from being made", vim.log.levels.ERROR)
    return
  end
  local scratch = scratch_for(target)
  vim.api.nvim_buf_set_option(scratch, "modifiable", true)
  vim.api.nvim_buf_set_lines(scratch, 0, -1, false, vim.split(file.text, "\r?\n"))
  vim.api.nvim_buf_set_option(scratch, "modifiable", false)
  follow(source, scratch, M.integers(file.lines))
end

--- Shows what a target makes of this buffer in a window beside it; the cursors of both go together.
function M.output(arguments)
  local source = vim.api.nvim_get_current_buf()
  local client = settings.client(source)
  if not client then
    vim.notify("gcc-robot: the language server is not running for this buffer", vim.log.levels.ERROR)
    return
  end
  local target = arguments[1]
  local ask = {
    textDocument = { uri = vim.uri_from_bufnr(source) },
    target = target,
    options = options_of(arguments),
  }
  client.request("gccRobot/output", ask, function(failure, output)
    if failure or not output then
      vim.notify("gcc-robot: " .. (failure and failure.message or "no output"), vim.log.levels.ERROR)
    else
      show_output(source, target, output)
    end
  end, source)
end

-- The diagnostic of the cursor's line, else the word under the cursor.
local function under_cursor()
  local here = vim.api.nvim_win_get_cursor(0)[1] - 1
  local found = vim.diagnostic.get(0, { lnum = here })[1]
  local code = found and (found.code or vim.tbl_get(found, "user_data", "lsp", "code"))
  return code or vim.fn.expand("<cword>")
end

--- Explains a code, a word or a diagnostic in a floating window.
function M.explain(name)
  local found = robot.program()
  if not found then
    return
  end
  if not name or name == "" then
    name = under_cursor()
  end
  local lines, status = program.run(found, { "explain", name })
  if status ~= 0 then
    vim.notify(table.concat(lines, "\n"), vim.log.levels.WARN)
    return
  end
  vim.lsp.util.open_floating_preview(lines, "markdown", { border = "single" })
end

return M
