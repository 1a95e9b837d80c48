// Starts `gcc-robot lsp` and hands it the G-code documents.
const vscode = require("vscode");
const { LanguageClient } = require("vscode-languageclient/node");

let client;

exports.activate = async () => {
  const command = vscode.workspace.getConfiguration("gcc-robot").get("server.path");
  const server = { command, args: ["lsp"] };
  client = new LanguageClient("gcc-robot", "gcc-robot", server, { documentSelector: [{ language: "gcode" }] });
  await client.start();
};

exports.deactivate = () => client?.stop();
