-- Commands; they load the rest when they are called.
if vim.g.loaded_gcc_robot then
  return
end
vim.g.loaded_gcc_robot = true

local function command(name, what, options)
  vim.api.nvim_create_user_command(name, what, options)
end

command("GccRobotPreview", function(event)
  require("gcc-robot.preview").start(nil, event.fargs)
end, { nargs = "*", desc = "Show the tool path of this file in a browser" })

command("GccRobotPreviewStop", function()
  require("gcc-robot.preview").stop()
end, { desc = "End the preview of this file" })

command("GccRobotBuild", function(event)
  require("gcc-robot.commands").build(event.fargs)
end, { nargs = "+", complete = function(...) return require("gcc-robot.commands").targets(...) end,
  desc = "Build this file for a target" })

command("GccRobotOutput", function(event)
  require("gcc-robot.commands").output(event.fargs)
end, { nargs = "+", complete = function(...) return require("gcc-robot.commands").targets(...) end,
  desc = "Show beside this file what is made of it for a target" })

command("GccRobotExplain", function(event)
  require("gcc-robot.commands").explain(event.args)
end, { nargs = "?", desc = "Explain a code, a word or a diagnostic; without argument what is under the cursor" })
