// The gcc-robot program: where it is, and the language client that talks to it.

import { existsSync } from "node:fs";
import { homedir } from "node:os";
import { delimiter, join } from "node:path";
import * as vscode from "vscode";
import { LanguageClient, RevealOutputChannelOn, State } from "vscode-languageclient/node";
import { analysed } from "./protocol";

export const LANGUAGES = ["gcode", "p21"];
const SECTION = "gccRobot";

function executable(): string {
  return process.platform === "win32" ? "gcc-robot.exe" : "gcc-robot";
}

/** The program: as set, in the extension, on the PATH, where cargo puts it. */
export function program(context: vscode.ExtensionContext): string | undefined {
  const set = vscode.workspace.getConfiguration(SECTION).get<string>("server.path")?.trim();
  if (set) {
    const path = set.startsWith("~/") ? join(homedir(), set.slice(2)) : set;
    return path.includes("/") || path.includes("\\") ? (existsSync(path) ? path : undefined) : path;
  }
  const folders = (process.env.PATH ?? "").split(delimiter).filter(Boolean);
  const places = [join(context.extensionPath, "server"), ...folders, join(homedir(), ".cargo", "bin")];
  return places.map((folder) => join(folder, executable())).find((path) => existsSync(path));
}

function settings(): unknown {
  return JSON.parse(JSON.stringify(vscode.workspace.getConfiguration(SECTION)));
}

export class Server implements vscode.Disposable {
  client: LanguageClient | undefined;
  private readonly analysed = new vscode.EventEmitter<vscode.Uri>();
  /** The server has finished with a version of a document: what is shown of it can be asked for again. */
  readonly onAnalysed = this.analysed.event;

  constructor(private readonly context: vscode.ExtensionContext) {}

  async start() {
    await this.stop();
    const command = program(this.context);
    if (!command) {
      void missing();
      return;
    }
    const client = new LanguageClient(
      SECTION,
      "gcc-robot",
      { command, args: ["lsp"] },
      {
        documentSelector: [
          ...LANGUAGES.map((language) => ({ scheme: "file", language })),
          ...LANGUAGES.map((language) => ({ scheme: "untitled", language })),
          // Machine files have any name: the server tells them from others by what is in them.
          { scheme: "file", pattern: "**/*.toml" },
          { scheme: "file", pattern: "**/*.{tbl,var,ini}" },
        ],
        // VS Code asks for diagnostics itself; sent ones too would be shown twice.
        initializationOptions: { gccRobot: settings(), pullDiagnostics: true, explainPages: true },
        synchronize: {
          configurationSection: SECTION,
          fileEvents: vscode.workspace.createFileSystemWatcher("**/*.{ngc,nc,tbl,var,ini,toml,NGC,NC,TBL,VAR,INI}"),
        },
        revealOutputChannelOn: RevealOutputChannelOn.Never,
      },
    );
    this.client = client;
    client.onNotification(analysed, ({ uri }) => this.analysed.fire(client.protocol2CodeConverter.asUri(uri)));
    try {
      await client.start();
    } catch (problem) {
      void vscode.window.showErrorMessage(`gcc-robot: ${command} lsp did not start: ${problem}`);
    }
  }

  async stop() {
    const client = this.client;
    this.client = undefined;
    if (client?.state === State.Running) await client.stop();
  }

  dispose() {
    void this.stop();
  }

  /** The running client; says so when there is none. */
  running(): LanguageClient | undefined {
    if (this.client?.state === State.Running) return this.client;
    void vscode.window.showWarningMessage("gcc-robot: the language server is not running.");
    return undefined;
  }
}

async function missing() {
  const set = "Name it in the settings";
  const chosen = await vscode.window.showErrorMessage(
    "The program gcc-robot was not found on the PATH. Install it with `cargo install --path compiler/cli` in a clone of the project.",
    set,
  );
  if (chosen === set) await vscode.commands.executeCommand("workbench.action.openSettings", `${SECTION}.server.path`);
}
