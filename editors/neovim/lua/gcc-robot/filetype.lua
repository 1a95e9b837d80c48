-- Which files are G-code, which are STEP-NC, and which are what programs are run with.
local M = {}

M.gcode = { "ngc", "nc", "cnc", "tap", "eia", "gc", "g", "gcode" }
M.p21 = { "p21", "stpnc" }
local maybe_p21 = { "stp", "step" }
-- Files that programs are run with. Machine files are TOML, INI files are "dosini": Neovim knows these.
M.tools = { "tbl" }
M.parameters = { "var" }

-- How the names of the schemas of ISO 14649 and AP238 begin.
local schemas = {
  "MACHINING_SCHEMA",
  "MILLING_SCHEMA",
  "TURNING_SCHEMA",
  "COMBINED_SCHEMA",
  "INTEGRATED_CNC_SCHEMA",
  "MODEL_BASED_INTEGRATED_MANUFACTURING",
  "AP238",
}

--- Whether the lines begin a Part 21 file with a schema of machining.
function M.is_stepnc(lines)
  local text = table.concat(lines, "\n"):upper()
  if not text:match("^%s*ISO%-10303%-21%s*;") then
    return false
  end
  local names = text:match("FILE_SCHEMA%s*(%b())") or ""
  for _, schema in ipairs(schemas) do
    if names:find("'%s*" .. schema) then
      return true
    end
  end
  return false
end

local function has(text, starts)
  for _, start in ipairs(starts) do
    if text:find("\n%s*" .. start) then
      return true
    end
  end
  return false
end

--- Whether a file that programs are run with is one of ours: project file, machine file, tool table, INI and parameter
--- file of LinuxCNC.
function M.is_beside(name, lines)
  local file = vim.fn.fnamemodify(name, ":t"):lower()
  if file == "gcc-robot.toml" or file:match("%.tbl$") or file:match("%.var$") then
    return true
  end
  local text = "\n" .. table.concat(lines, "\n")
  if file:match("%.toml$") then
    return has(text, { "format" }) and has(text, { "%[kinematics%]", "extends", "%[%[joint%]%]" })
  end
  return file:match("%.ini$") ~= nil and has(text, { "%[RS274NGC%]", "%[EMC%]", "%[EMCIO%]", "%[TRAJ%]", "%[KINS%]" })
end

local function head(buffer)
  return vim.api.nvim_buf_get_lines(buffer, 0, 200, false)
end

local function any_case(ending)
  return (ending:gsub("%a", function(c)
    return "[" .. c:lower() .. c:upper() .. "]"
  end))
end

local function add_by_pattern()
  local pattern = {}
  local function add(endings, found)
    for _, ending in ipairs(endings) do
      pattern[".*%." .. any_case(ending)] = { found, { priority = 10 } }
    end
  end
  add(M.gcode, "gcode")
  add(M.p21, "p21")
  add(M.tools, "tooltable")
  add(M.parameters, "cncparameters")
  add(maybe_p21, function(_, buffer)
    return M.is_stepnc(head(buffer)) and "p21" or nil
  end)
  vim.filetype.add({ pattern = pattern })
end

local function add_by_event()
  local group = vim.api.nvim_create_augroup("GccRobotFiletype", { clear = true })
  local function add(endings, ours)
    local pattern = {}
    for _, ending in ipairs(endings) do
      table.insert(pattern, "*." .. any_case(ending))
    end
    vim.api.nvim_create_autocmd({ "BufRead", "BufNewFile" }, {
      group = group,
      pattern = pattern,
      callback = function(event)
        local filetype = ours(event.buf)
        if filetype then
          vim.api.nvim_buf_set_option(event.buf, "filetype", filetype)
        end
      end,
    })
  end
  add(M.gcode, function()
    return "gcode"
  end)
  add(M.p21, function()
    return "p21"
  end)
  add(M.tools, function()
    return "tooltable"
  end)
  add(M.parameters, function()
    return "cncparameters"
  end)
  add(maybe_p21, function(buffer)
    return M.is_stepnc(head(buffer)) and "p21" or nil
  end)
end

--- Makes Neovim know them. Before 0.8 names are looked at by autocommands.
function M.register()
  if vim.fn.has("nvim-0.8") == 1 then
    add_by_pattern()
  else
    add_by_event()
  end
end

return M
