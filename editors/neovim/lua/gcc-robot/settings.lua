-- The settings of the server as options of the program, so that what is made is what the editor shows.
local M = {}

--- The client of this server that a buffer is attached to.
function M.client(buffer)
  local get = vim.lsp.get_clients or vim.lsp.get_active_clients
  for _, client in ipairs(get()) do
    local ours = client.name == "gcc-robot" or client.name == "gcc_robot"
    if ours and vim.lsp.buf_is_attached(buffer, client.id) then
      return client
    end
  end
  return nil
end

local function of(buffer)
  local client = M.client(buffer)
  if not client then
    return {}
  end
  local ask = { textDocument = { uri = vim.uri_from_bufnr(buffer) } }
  local answer = client.request_sync("gccRobot/buildOptions", ask, 5000, buffer)
  local options = answer and answer.result and answer.result ~= vim.NIL and answer.result.options
  return options or {}
end

-- Options without those that are given again; switches have no value behind them.
local function without(options, given)
  local again, long = {}, { ["-t"] = "--tools", ["-i"] = "--ini" }
  for _, word in ipairs(given) do
    again[word:match("^%-%-[^=]+") or long[word:sub(1, 2)] or word] = true
  end
  local kept, i = {}, 1
  while i <= #options do
    local value = options[i + 1]
    local has_value = value and not vim.startswith(value, "--")
    if not again[options[i]] then
      vim.list_extend(kept, options, i, has_value and i + 1 or i)
    end
    i = i + (has_value and 2 or 1)
  end
  return kept
end

--- Options for a buffer, without those that are `given` by hand: an option must not come twice.
function M.options(buffer, given)
  return without(of(buffer), given)
end

local lints = { ["--allow"] = true, ["--warn"] = true, ["--deny"] = true, ["--strict"] = true }

--- The same for commands that report no findings.
function M.without_lints(buffer, given)
  local kept, skip = {}, false
  for _, word in ipairs(M.options(buffer, given)) do
    if lints[word] then
      skip = word ~= "--strict"
    elseif skip then
      skip = false
    else
      table.insert(kept, word)
    end
  end
  return kept
end

return M
