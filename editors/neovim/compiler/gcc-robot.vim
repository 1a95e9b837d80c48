" Finds errors of `gcc-robot check` and `gcc-robot build`: :compiler gcc-robot, then :make
if exists("current_compiler")
  finish
endif
let current_compiler = "gcc-robot"
CompilerSet makeprg=gcc-robot\ --message-format\ short\ check\ %:S
CompilerSet errorformat=%f:%l:%c:\ %trror[%.%#]:\ %m,%f:%l:%c:\ %tarning[%.%#]:\ %m,%f:%l:%c:\ %tint[%.%#]:\ %m,%-G%.%#
