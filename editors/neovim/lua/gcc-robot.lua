-- Starts `gcc-robot lsp` for G-code buffers.
local M = {}

--- opts.cmd: how the server is started; default { "gcc-robot", "lsp" }.
function M.setup(opts)
  opts = opts or {}
  vim.api.nvim_create_autocmd("FileType", {
    pattern = "gcode",
    callback = function(event)
      vim.bo[event.buf].commentstring = "(%s)"
      vim.lsp.start({
        name = "gcc-robot",
        cmd = opts.cmd or { "gcc-robot", "lsp" },
        root_dir = vim.fs.dirname(vim.fs.find({ "gcc-robot.toml" }, { upward = true, path = event.file })[1]),
      })
    end,
  })
end

return M
