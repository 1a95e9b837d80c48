-- Runs in a headless Neovim with test/init.lua: real files, real server, contents are asserted.
-- GCC_ROBOT_BIN: the program. Ends Neovim with status 1 when something fails.
local top = vim.fn.fnamemodify(debug.getinfo(1, "S").source:sub(2), ":p:h:h:h:h")
local scratch = vim.fn.tempname()
vim.fn.mkdir(scratch, "p")

local done, failed = 0, 0

local function say(text)
  io.stdout:write(text .. "\n")
end

local function test(name, body)
  local good, problem = xpcall(body, debug.traceback)
  done = done + 1
  if good then
    say("ok      " .. name)
  else
    failed = failed + 1
    say("FAILED  " .. name .. "\n" .. problem)
  end
  vim.cmd("silent! %bwipeout!")
end

local function equal(got, wanted, what)
  if not vim.deep_equal(got, wanted) then
    error((what or "") .. " is\n" .. vim.inspect(got) .. "\nand should be\n" .. vim.inspect(wanted), 2)
  end
end

local function contains(text, part)
  if not tostring(text):find(part, 1, true) then
    error("`" .. part .. "` is not in\n" .. tostring(text), 2)
  end
end

local function wait(what, condition, milliseconds)
  if not vim.wait(milliseconds or 30000, condition, 5) then
    error("waited in vain for " .. what, 2)
  end
end

local function clients(buffer)
  local found = {}
  for _, c in ipairs((vim.lsp.get_clients or vim.lsp.get_active_clients)()) do
    if vim.lsp.buf_is_attached(buffer, c.id) then
      table.insert(found, c)
    end
  end
  return found
end

-- Waits until a server has taken the buffer.
local function served(buffer)
  wait("the server", function()
    local c = clients(buffer)[1]
    return c and (c.initialized or c.server_capabilities)
  end)
  return buffer
end

-- Opens a copy of a shipped file (so that tests may write) and waits for the server.
local function open(path, name)
  local copy = scratch .. "/" .. (name or vim.fn.fnamemodify(path, ":t"))
  vim.fn.writefile(vim.fn.readfile(top .. "/" .. path, "b"), copy, "b")
  vim.cmd("edit " .. vim.fn.fnameescape(copy))
  return served(vim.api.nvim_get_current_buf())
end

local function request(buffer, method, params)
  local answer
  wait("the answer to " .. method, function()
    if not answer then
      local all = vim.lsp.buf_request_sync(buffer, method, params, 10000) or {}
      for _, one in pairs(all) do
        answer = one
      end
    end
    return answer
  end)
  if answer.error then
    error(method .. ": " .. vim.inspect(answer.error), 2)
  end
  return answer.result
end

-- Line from 1, column from 0.
local function at(line, column)
  vim.api.nvim_win_set_cursor(0, { line, column })
  local encoding = clients(0)[1] and clients(0)[1].offset_encoding
  return vim.lsp.util.make_position_params(0, encoding)
end

local function line_of(buffer, text)
  for i, line in ipairs(vim.api.nvim_buf_get_lines(buffer, 0, -1, false)) do
    local column = line:find(text, 1, true)
    if column then
      return i, column - 1
    end
  end
  error("no line with " .. text, 2)
end

local function diagnostics(buffer)
  local found = vim.tbl_map(function(d)
    local code = d.code or (d.user_data and d.user_data.lsp and d.user_data.lsp.code)
    return { line = d.lnum + 1, code = code, severity = d.severity, message = d.message }
  end, vim.diagnostic.get(buffer))
  table.sort(found, function(a, b)
    return a.line < b.line
  end)
  return found
end

local function filetype_of(name, lines)
  local path = scratch .. "/" .. name
  vim.fn.writefile(lines or { "G0 X0" }, path)
  vim.cmd("edit " .. vim.fn.fnameescape(path))
  return vim.bo.filetype
end

test("the root is found in a folder with blanks and commas", function()
  local folder = scratch .. "/my parts, all"
  vim.fn.mkdir(folder .. "/sub", "p")
  vim.fn.writefile({ "schema = 1" }, folder .. "/gcc-robot.toml")
  equal(require("gcc-robot").root(folder .. "/sub/pocket.ngc"), folder, "the root")
end)

test("names of G-code files, any case", function()
  for _, ending in ipairs({ "ngc", "NGC", "nc", "Nc", "cnc", "tap", "eia", "gc", "g", "gcode", "GCODE" }) do
    equal(filetype_of("part." .. ending), "gcode", ending)
  end
  equal(vim.bo.commentstring, "(%s)")
end)

test("STEP-NC files by header", function()
  local header = function(schema)
    return { "ISO-10303-21;", "HEADER;", "FILE_SCHEMA(('" .. schema .. "'));", "ENDSEC;" }
  end
  equal(filetype_of("a.p21"), "p21")
  equal(filetype_of("a.STPNC"), "p21")
  equal(filetype_of("a.stp", header("MACHINING_SCHEMA { 1 0 14649 111 }")), "p21")
  equal(filetype_of("b.STEP", header("COMBINED_SCHEMA")), "p21")
  local product = filetype_of("c.stp", header("AUTOMOTIVE_DESIGN"))
  assert(product ~= "p21", product)
  local text = filetype_of("d.step", { "dance" })
  assert(text ~= "p21", text)
end)

test("diagnostics: codes, lines, words", function()
  local buffer = open("docs/examples/mistakes.ngc")
  wait("diagnostics", function()
    return #vim.diagnostic.get(buffer) >= 4
  end)
  local by_line = {}
  for _, d in ipairs(diagnostics(buffer)) do
    by_line[d.line] = by_line[d.line] or d
  end
  equal(by_line[7].code, "E0203")
  equal(by_line[7].severity, vim.diagnostic.severity.ERROR)
  contains(by_line[7].message, "radius 4.0000 at the start, 6.0000 at the end")
  equal(by_line[8].code, "E0212")
  equal(by_line[9].code, "E0205")
  -- Answers come in order: whatever the server had to say of this text has come.
  request(buffer, "textDocument/hover", at(7, 1))
  local seventh = vim.tbl_filter(function(d)
    return d.line == 7
  end, diagnostics(buffer))
  equal(#seventh, 1, "number of findings in line 7")
end)

test("diagnostics follow an edit", function()
  local buffer = open("docs/examples/mistakes.ngc")
  local function has(code)
    return vim.tbl_contains(vim.tbl_map(function(d) return d.code end, diagnostics(buffer)), code)
  end
  wait("diagnostics", function() return has("E0203") end)
  vim.api.nvim_buf_set_lines(buffer, 6, 7, false, { "G2 X10 Y0 I5 J0" })
  wait("E0203 to go", function() return not has("E0203") end)
  assert(has("E0212"), "the other mistakes stay")
end)

test("hover tells what a word means", function()
  local buffer = open("docs/examples/flange.ngc")
  local line, column = line_of(buffer, "G43 H1")
  local answer = request(buffer, "textDocument/hover", at(line, column))
  local text = type(answer.contents) == "table" and answer.contents.value or answer.contents
  contains(text, "G43")
  contains(text:lower(), "tool length")
end)

test("definition of a subprogram", function()
  local buffer = open("docs/examples/flange.ngc")
  local line, column = line_of(buffer, "o<contour> call [8]")
  local wanted = line_of(buffer, "o<contour> sub")
  local answer = request(buffer, "textDocument/definition", at(line, column + 3))
  local place = answer[1] or answer
  local range = place.range or place.targetSelectionRange
  equal(range.start.line + 1, wanted)
  vim.lsp.buf.definition()
  wait("the cursor on the definition", function()
    return vim.api.nvim_win_get_cursor(0)[1] == wanted
  end)
end)

test("rename of a subprogram changes the definition and every call", function()
  local buffer = open("docs/examples/flange.ngc")
  local line, column = line_of(buffer, "o<contour> call [8]")
  at(line, column + 3)
  vim.lsp.buf.rename("outline")
  wait("the new name", function()
    return vim.api.nvim_buf_get_lines(buffer, line - 1, line, false)[1] == "o<outline> call [8]"
  end)
  local text = table.concat(vim.api.nvim_buf_get_lines(buffer, 0, -1, false), "\n")
  local _, new = text:gsub("o<outline>", "")
  equal(new, 4, "number of new names")
  assert(not text:find("o<contour>", 1, true))
  assert(text:find("#<_contour_safe>", 1, true), "parameters keep their names")
end)

test("rename of a parameter", function()
  local buffer = open("docs/examples/flange.ngc")
  local line, column = line_of(buffer, "#<depth> = 6")
  at(line, column + 3)
  vim.lsp.buf.rename("pocket_depth")
  wait("the new name", function()
    local text = table.concat(vim.api.nvim_buf_get_lines(buffer, 0, -1, false), "\n")
    local _, new = text:gsub("#<pocket_depth>", "")
    return new == 4 and not text:find("#<depth>", 1, true)
  end)
end)

test("formatting keeps the program and tidies the text", function()
  local buffer = open("docs/examples/flange.ngc", "tidy.ngc")
  local line = line_of(buffer, "G64 P0.02")
  vim.api.nvim_buf_set_lines(buffer, line - 1, line, false, { "  g64   p0.02" })
  local options = { textDocument = { uri = vim.uri_from_bufnr(buffer) }, options = { tabSize = 2, insertSpaces = true } }
  local edits = request(buffer, "textDocument/formatting", options)
  vim.lsp.util.apply_text_edits(edits, buffer, clients(buffer)[1].offset_encoding or "utf-16")
  equal(vim.api.nvim_buf_get_lines(buffer, line - 1, line, false)[1], "G64 P0.02")
  local inside = line_of(buffer, "G41 D1")
  equal(vim.api.nvim_buf_get_lines(buffer, inside - 1, inside, false)[1], "  G41 D1", "indentation")
end)

test("outline names tools and subprograms", function()
  local buffer = open("docs/examples/flange.ngc")
  local answer = request(buffer, "textDocument/documentSymbol", { textDocument = { uri = vim.uri_from_bufnr(buffer) } })
  contains(vim.inspect(answer), "contour")
end)

test("STEP-NC: hover and definition of a reference", function()
  local buffer = open("tests/golden/ufsc2016/example1.p21")
  local line, column
  for i, text in ipairs(vim.api.nvim_buf_get_lines(buffer, 0, -1, false)) do
    if text:match("^#%d+%s*=%s*MACHINING_WORKINGSTEP") then
      line, column = i, text:find("#%d+", 5) - 1
      break
    end
  end
  local here = vim.api.nvim_buf_get_lines(buffer, line - 1, line, false)[1]
  local name = here:match("#%d+", column + 1)
  local answer = request(buffer, "textDocument/definition", at(line, column + 1))
  local place = answer[1] or answer
  local range = place.range or place.targetSelectionRange
  local target = vim.api.nvim_buf_get_lines(buffer, range.start.line, range.start.line + 1, false)[1]
  assert(target:match("^" .. name .. "%s*="), target)
  local word = here:find("MACHINING_WORKINGSTEP")
  local hover = request(buffer, "textDocument/hover", at(line, word))
  contains(vim.inspect(hover):lower(), "workingstep")
end)

test("build fills the quickfix list", function()
  open("docs/examples/mistakes.ngc")
  require("gcc-robot.commands").build({ "rs274ngc" })
  local found = vim.tbl_filter(function(q) return q.valid == 1 end, vim.fn.getqflist())
  equal({ found[1].lnum, found[1].col, found[1].type }, { 7, 11, "e" })
  contains(found[1].text, "not equally far from its centre")
end)

test("build writes the program", function()
  open("docs/examples/flange.ngc")
  require("gcc-robot.commands").build({ "rs274ngc", "--tools", top .. "/docs/examples/tools.tbl" })
  contains(table.concat(vim.fn.readfile(scratch .. "/build/flange.ngc"), "\n"), "M30")
end)

test("build is told the settings of the server", function()
  local buffer = open("docs/examples/flange.ngc", "told.ngc")
  local client = clients(buffer)[1]
  local settings = { gccRobot = { tools = scratch .. "/told.tbl", blockDelete = true } }
  vim.fn.writefile({ "T1 P1 Z71 D10", "T2 P2 Z72 D6.8", "T3 P3 Z73 D4.2" }, scratch .. "/told.tbl")
  client.config.settings = settings
  client.settings = settings
  client.notify("workspace/didChangeConfiguration", { settings = settings })
  wait("the settings", function()
    local told = request(buffer, "gccRobot/buildOptions", { textDocument = { uri = vim.uri_from_bufnr(buffer) } })
    return vim.tbl_contains(told.options, "--block-delete")
  end)
  local run, command = require("gcc-robot.program").run, nil
  require("gcc-robot.program").run = function(program, arguments)
    command = table.concat(arguments, " ")
    return run(program, arguments)
  end
  require("gcc-robot.commands").build({ "canon" })
  contains(command, "--tools " .. scratch .. "/told.tbl --block-delete")
  contains(table.concat(vim.fn.readfile(scratch .. "/build/told.canon"), "\n"), "71.0000")
  -- The preview is told the same, but for lints, which it doesn't know.
  settings.gccRobot.lints = { allow = { "end/spindle-on" }, strict = true }
  client.notify("workspace/didChangeConfiguration", { settings = settings })
  wait("the lints", function()
    local told = request(buffer, "gccRobot/buildOptions", { textDocument = { uri = vim.uri_from_bufnr(buffer) } })
    return vim.tbl_contains(told.options, "--strict")
  end)
  local start, previewed = vim.fn.jobstart, nil
  vim.fn.jobstart = function(words, options)
    if words[2] == "preview" then
      previewed = table.concat(words, " ", 5)
    end
    return start(words, options)
  end
  vim.cmd("GccRobotPreview --machine-units mm")
  vim.fn.jobstart = start
  equal(previewed, "--editor --tools " .. scratch .. "/told.tbl --block-delete --machine-units mm")
  vim.cmd("GccRobotPreviewStop")
  -- What is named by hand is not named twice.
  require("gcc-robot.commands").build({ "canon", "-t", top .. "/docs/examples/tools.tbl" })
  require("gcc-robot.program").run = run
  assert(not command:find("told.tbl", 1, true), command)
  client.config.settings, client.settings = {}, {}
  client.notify("workspace/didChangeConfiguration", { settings = { gccRobot = {} } })
end)

test("output beside the source; cursors go together", function()
  local buffer = open("docs/examples/flange.ngc", "beside.ngc")
  local here = vim.api.nvim_get_current_win()
  require("gcc-robot.commands").output({ "rs274ngc", "decimals=3" })
  wait("the output", function()
    local other = vim.fn.bufnr("gcc-robot://rs274ngc")
    return other ~= -1 and vim.api.nvim_buf_line_count(other) > 20
  end)
  local other = vim.fn.bufnr("gcc-robot://rs274ngc")
  local line = line_of(buffer, "T2 M6")
  vim.api.nvim_set_current_win(here)
  vim.api.nvim_win_set_cursor(here, { line, 0 })
  vim.cmd("doautocmd CursorMoved")
  local there = vim.api.nvim_win_get_cursor(vim.fn.bufwinid(other))[1]
  local text = table.concat(vim.api.nvim_buf_get_lines(other, there - 1, there + 1, false), "\n")
  contains(text, "T2")
end)

test("explain shows the long text of a diagnostic", function()
  open("docs/examples/mistakes.ngc")
  require("gcc-robot.commands").explain("E0203")
  local shown
  for _, window in ipairs(vim.api.nvim_list_wins()) do
    if vim.api.nvim_win_get_config(window).relative ~= "" then
      shown = table.concat(vim.api.nvim_buf_get_lines(vim.api.nvim_win_get_buf(window), 0, -1, false), "\n")
    end
  end
  contains(shown, "E0203")
end)

-- One request over a socket; the page's browser speaks the same.
local function http(address, method, path, body)
  local host, port, base = address:match("^http://([%d.]+):(%d+)(/.*)$")
  local answer, closed = "", false
  local socket = vim.loop.new_tcp()
  socket:connect(host, tonumber(port), function()
    socket:write(("%s %s%s HTTP/1.1\r\nHost: %s:%s\r\nContent-Length: %d\r\n\r\n%s"):format(method, base, path, host, port, #body, body))
    socket:read_start(function(_, data)
      answer = answer .. (data or "")
      closed = data == nil
    end)
  end)
  wait("the answer of " .. address, function()
    return closed
  end)
  socket:close()
  return answer
end

test("preview: the page is served, follows the text, and moves the cursor", function()
  local robot = require("gcc-robot")
  local address
  robot.options.open = function(given)
    address = given
  end
  local buffer = open("docs/examples/flange.ngc", "shown.ngc")
  vim.cmd("GccRobotPreview")
  wait("the page", function()
    return address
  end)
  equal(require("gcc-robot.preview").address(buffer), address)
  contains(http(address, "GET", "", ""), "<gcc-robot-preview>")
  contains(http(address, "GET", "path", ""), '"positions"')
  contains(http(address:gsub("/%x+/$", "/0/"), "GET", "path", ""), "404")
  contains(http(address, "POST", "choose", "52"), "204")
  wait("the chosen line", function()
    return vim.api.nvim_win_get_cursor(0)[1] == 53
  end)
  vim.api.nvim_buf_set_lines(buffer, 52, 53, false, { "G3 I-13 J1 F900 Q" })
  vim.cmd("doautocmd TextChanged")
  wait("the mistake in the page", function()
    return http(address, "GET", "path", ""):find("line 53", 1, true)
  end)
  vim.cmd("GccRobotPreviewStop")
  wait("the end", function()
    return require("gcc-robot.preview").address(buffer) == nil
  end)
  robot.options.open = nil
end)

test("numbers of the requests", function()
  equal(require("gcc-robot.commands").integers("AQAAAP////8="), { 1, 4294967295 })
end)

test("health names program and server", function()
  open("docs/examples/flange.ngc")
  vim.cmd("checkhealth gcc-robot")
  local text = table.concat(vim.api.nvim_buf_get_lines(0, 0, -1, false), "\n")
  contains(text, "gcc-robot 0.")
  contains(text, "running in ")
end)

test("files that programs are run with", function()
  local function opened(name, lines)
    vim.fn.writefile(lines, scratch .. "/" .. name)
    vim.cmd("edit " .. scratch .. "/" .. name)
    return vim.api.nvim_get_current_buf()
  end
  local function told(buffer, line)
    local at = { textDocument = { uri = vim.uri_from_bufnr(buffer) }, position = { line = line, character = 1 } }
    local found = request(buffer, "textDocument/hover", at)
    return found and found.contents.value or ""
  end
  contains(told(served(opened("mill.tbl", { "T1 P1 D6 ;end mill" })), 0), "tool number")
  contains(told(served(opened("mill.var", { "5221\t12.5" })), 0), "#5221")
  contains(told(served(opened("mill.ini", { "[TRAJ]", "LINEAR_UNITS = mm" })), 1), "unit of length")
  contains(told(served(opened("gcc-robot.toml", { "schema = 1", "[project]", "sources = []" })), 2), "Programs")
  local machine = vim.fn.readfile(top .. "/docs/examples/irb2400-cell.toml")
  served(opened("cell.toml", machine))
  -- Files of others are left alone.
  equal(#clients(opened("other.toml", { "[package]", 'name = "x"' })), 0)
  equal(#clients(opened("other.ini", { "[core]", "x = 1" })), 0)
  vim.fn.delete(scratch .. "/gcc-robot.toml")
end)

test("names of STEP-NC lead to their pages", function()
  local buffer = open("tests/golden/ufsc2016/example1.p21")
  local line
  for n, text in ipairs(vim.api.nvim_buf_get_lines(buffer, 0, -1, false)) do
    line = line or (text:match("^#%d+=MACHINING_WORKINGSTEP") and n)
  end
  local column = vim.api.nvim_buf_get_lines(buffer, line - 1, line, false)[1]:find("MACHINING")
  local at = { textDocument = { uri = vim.uri_from_bufnr(buffer) }, position = { line = line - 1, character = column } }
  local found = request(buffer, "textDocument/definition", at)
  equal(found[1].uri, "gcc-robot-explain:/MACHINING_WORKINGSTEP.md")
  vim.lsp.util.jump_to_location(found[1], "utf-16")
  contains(table.concat(vim.api.nvim_buf_get_lines(0, 0, -1, false), "\n"), "`its_feature`")
end)

-- Neovim 0.11 is not packaged by Debian 12: its way of starting servers is recorded.
test("0.11: vim.lsp.config and vim.lsp.enable", function()
  local config, enable = vim.lsp.config, vim.lsp.enable
  local given, enabled
  vim.lsp.config = function(name, options) given = { name = name, options = options } end
  vim.lsp.enable = function(name) enabled = name end
  require("gcc-robot").setup({ settings = { dialect = "fanuc-mill" } })
  vim.lsp.config, vim.lsp.enable = config, enable
  equal(enabled, "gcc_robot")
  equal(given.name, "gcc_robot")
  equal(given.options.cmd, { vim.env.GCC_ROBOT_BIN, "lsp" })
  equal(given.options.settings, { gccRobot = { dialect = "fanuc-mill" } })
  local found = dofile(vim.api.nvim_get_runtime_file("lsp/gcc_robot.lua", false)[1])
  equal(found.filetypes, { "gcode", "p21", "toml", "dosini", "tooltable", "cncparameters" })
  local roots = {}
  for _, path in ipairs({ "docs/examples/flange.ngc", "docs/examples/irb2400-cell.toml", "editors/neovim/test/init.lua" }) do
    vim.cmd("edit " .. top .. "/" .. path)
    found.root_dir(vim.api.nvim_get_current_buf(), function(root)
      table.insert(roots, vim.fn.fnamemodify(root, ":t"))
    end)
  end
  equal(#roots, 2, "buffers of ours")
  equal(found.cmd, { vim.env.GCC_ROBOT_BIN, "lsp" })
  require("gcc-robot").options.settings = {}
end)

if vim.lsp.inlay_hint then
  test("inlay hints", function()
    local buffer = open("docs/examples/flange.ngc")
    local params = {
      textDocument = { uri = vim.uri_from_bufnr(buffer) },
      range = { start = { line = 0, character = 0 }, ["end"] = { line = vim.api.nvim_buf_line_count(buffer), character = 0 } },
    }
    assert(#request(buffer, "textDocument/inlayHint", params) > 5)
  end)
end

say(("%d tests, %d failed, Neovim %d.%d.%d"):format(done, failed, vim.version().major, vim.version().minor, vim.version().patch))
vim.cmd(failed == 0 and "qall!" or "cquit! 1")
