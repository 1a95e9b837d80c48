-- The tool path in a browser beside the text. The program serves the page on this computer only; lines go
-- both ways over its standard input and output, one JSON object per line.
local M = {}

local robot = require("gcc-robot")

-- Preview of each buffer: job, address, timer.
local shown = {}

local function open(address)
  if robot.options.open then
    robot.options.open(address)
  elseif vim.ui.open then
    vim.ui.open(address)
  else
    local opener = vim.fn.has("mac") == 1 and "open" or "xdg-open"
    if vim.fn.executable(opener) == 1 then
      vim.fn.jobstart({ opener, address }, { detach = true })
    end
  end
  vim.api.nvim_echo({ { "preview: " .. address } }, true, {})
end

local function send(preview, message)
  pcall(vim.fn.chansend, preview.job, vim.json.encode(message) .. "\n")
end

-- A segment was clicked: its line is shown in a window of the buffer.
local function jump(buffer, line)
  local window = vim.fn.bufwinid(buffer)
  if window == -1 then
    vim.cmd("sbuffer " .. buffer)
    window = vim.api.nvim_get_current_win()
  end
  local last = vim.api.nvim_buf_line_count(buffer)
  vim.api.nvim_win_set_cursor(window, { math.min(math.max(line, 1), last), 0 })
end

local function hear(buffer, line)
  local good, message = pcall(vim.json.decode, line)
  if not good or type(message) ~= "table" then
    return
  end
  local preview = shown[buffer]
  if not preview then
    return
  end
  if message.url then
    preview.address = message.url
    open(message.url)
  elseif message.line then
    jump(buffer, message.line)
  end
end

-- Output comes in pieces; the last element of `data` is an unfinished line.
local function listener(buffer)
  local rest = ""
  return function(_, data)
    data[1] = rest .. data[1]
    rest = table.remove(data)
    for _, line in ipairs(data) do
      hear(buffer, line)
    end
  end
end

local function send_text(buffer)
  local preview = shown[buffer]
  if preview then
    local lines = vim.api.nvim_buf_get_lines(buffer, 0, -1, false)
    send(preview, { text = table.concat(lines, "\n") .. "\n" })
  end
end

-- Text is sent when typing pauses.
local function text_soon(buffer)
  local preview = shown[buffer]
  if not preview then
    return
  end
  preview.timer:stop()
  preview.timer:start(150, 0, vim.schedule_wrap(function()
    send_text(buffer)
  end))
end

local function follow(buffer)
  local group = vim.api.nvim_create_augroup("GccRobotPreview" .. buffer, { clear = true })
  vim.api.nvim_create_autocmd({ "CursorMoved", "CursorMovedI" }, {
    group = group,
    buffer = buffer,
    callback = function()
      local preview = shown[buffer]
      local line = vim.api.nvim_win_get_cursor(0)[1]
      if preview and preview.line ~= line then
        preview.line = line
        send(preview, { line = line })
      end
    end,
  })
  vim.api.nvim_create_autocmd({ "TextChanged", "TextChangedI" }, {
    group = group,
    buffer = buffer,
    callback = function()
      text_soon(buffer)
    end,
  })
  vim.api.nvim_create_autocmd({ "BufUnload", "VimLeavePre" }, {
    group = group,
    buffer = buffer,
    callback = function()
      M.stop(buffer)
    end,
  })
end

--- Shows the tool path of a buffer; again: opens the same page once more. `arguments` go to the program.
function M.start(buffer, arguments)
  buffer = buffer == nil and vim.api.nvim_get_current_buf() or buffer
  if shown[buffer] then
    if shown[buffer].address then
      open(shown[buffer].address)
    end
    return
  end
  local name = vim.api.nvim_buf_get_name(buffer)
  local program = robot.program()
  if name == "" or not program then
    return
  end
  local command = { program, "preview", name, "--serve", "--editor" }
  vim.list_extend(command, require("gcc-robot.settings").without_lints(buffer, arguments or {}))
  vim.list_extend(command, arguments or {})
  local said = {}
  local job = vim.fn.jobstart(command, {
    cwd = robot.root(name),
    on_stdout = listener(buffer),
    on_stderr = function(_, data)
      vim.list_extend(said, data)
    end,
    on_exit = function(_, status)
      M.stop(buffer)
      if status ~= 0 and status ~= 143 then
        vim.notify("gcc-robot preview: " .. table.concat(said, "\n"), vim.log.levels.ERROR)
      end
    end,
  })
  if job <= 0 then
    vim.notify("gcc-robot preview could not be started", vim.log.levels.ERROR)
    return
  end
  shown[buffer] = { job = job, timer = vim.loop.new_timer() }
  follow(buffer)
  if vim.bo[buffer].modified then
    send_text(buffer)
  end
end

--- Ends the preview of a buffer.
function M.stop(buffer)
  buffer = buffer == nil and vim.api.nvim_get_current_buf() or buffer
  local preview = shown[buffer]
  if not preview then
    return
  end
  shown[buffer] = nil
  preview.timer:stop()
  preview.timer:close()
  pcall(vim.api.nvim_del_augroup_by_name, "GccRobotPreview" .. buffer)
  vim.fn.jobstop(preview.job)
end

--- Address of the page of a buffer, once it is served.
function M.address(buffer)
  return shown[buffer] and shown[buffer].address
end

return M
