// Starts `gcc-robot lsp` for G-code and STEP-NC, and adds what the protocol does not have: tool path, output beside
// the source, builds.

import * as vscode from "vscode";
import { registerCommands, registerStatus } from "./commands";
import { Outputs } from "./output";
import { Previews } from "./preview";
import { Server } from "./server";
import { registerStepNc } from "./stepnc";
import { registerTasks } from "./tasks";

let server: Server | undefined;

export async function activate(context: vscode.ExtensionContext) {
  server = new Server(context);
  context.subscriptions.push(server);
  const previews = new Previews(context, server);
  const outputs = new Outputs(context, server);
  registerCommands(context, server, previews, outputs);
  registerStatus(context);
  registerTasks(context);
  registerStepNc(context);
  context.subscriptions.push(
    vscode.workspace.onDidChangeConfiguration((e) => {
      if (e.affectsConfiguration("gccRobot.server.path")) void server?.start();
    }),
  );
  await server.start();
}

export async function deactivate() {
  await server?.stop();
}
