vim.bo.commentstring = "/* %s */"
vim.bo.iskeyword = "@,48-57,_,#"
vim.b.undo_ftplugin = "setlocal commentstring< iskeyword<"
