// What the commands do: choosing, building, explaining.

import { dirname, join } from "node:path";
import * as vscode from "vscode";
import { formatOptions, type Outputs, parseOptions } from "./output";
import type { Previews } from "./preview";
import { buildOptions, type Choice, choices, explain } from "./protocol";
import { LANGUAGES, type Server } from "./server";
import { task } from "./tasks";

interface Item extends vscode.QuickPickItem {
  id: string;
}

function item(choice: Choice): Item {
  const status = choice.status && choice.status !== "stable" ? ` (${choice.status})` : "";
  return {
    id: choice.id,
    label: choice.id || "none",
    description: choice.title + status,
    detail: choice.options?.join(", "),
  };
}

/** The document that a command is about. */
function document(): vscode.TextDocument | undefined {
  const active = vscode.window.activeTextEditor?.document;
  const found =
    active && LANGUAGES.includes(active.languageId)
      ? active
      : vscode.window.visibleTextEditors.find((e) => LANGUAGES.includes(e.document.languageId))?.document;
  if (!found) void vscode.window.showInformationMessage("gcc-robot: open a G-code or STEP-NC program first.");
  return found;
}

async function choose(server: Server, kind: "targets" | "machines" | "dialects", title: string, none?: string) {
  const client = server.running();
  if (!client) return undefined;
  const all = (await client.sendRequest(choices))[kind].filter((c) => c.status !== "planned").map(item);
  if (none) all.unshift({ id: "", label: none });
  return vscode.window.showQuickPick(all, { title, matchOnDescription: true, matchOnDetail: true });
}

/** Writes a setting for the workspace, or for the user when there is none. */
async function set(key: string, value: string) {
  const goal = vscode.workspace.workspaceFolders
    ? vscode.ConfigurationTarget.Workspace
    : vscode.ConfigurationTarget.Global;
  await vscode.workspace.getConfiguration("gccRobot").update(key, value || undefined, goal);
}

async function build(context: vscode.ExtensionContext, server: Server) {
  const source = document();
  if (!source) return;
  const target = await choose(server, "targets", "Build for which target?");
  if (!target) return;
  await source.save();
  const folder = join(dirname(source.uri.fsPath), "build");
  await vscode.workspace.fs.createDirectory(vscode.Uri.file(folder));
  const textDocument = { uri: source.uri.toString() };
  const args = (await server.running()?.sendRequest(buildOptions, { textDocument }))?.options ?? [];
  const definition = {
    type: "gcc-robot",
    command: "build" as const,
    file: source.uri.fsPath,
    target: target.id,
    output: `${folder}/`,
    args,
  };
  await vscode.tasks.executeTask(task(context, definition, vscode.workspace.getWorkspaceFolder(source.uri)));
}

async function showOutput(server: Server, outputs: Outputs) {
  const source = document();
  if (!source) return;
  const target = await choose(server, "targets", "Show what is made for which target?");
  if (target) await outputs.show(source.uri, target.id, {});
}

async function outputOptions(outputs: Outputs) {
  const found = outputs.of(vscode.window.activeTextEditor?.document.uri);
  if (!found) {
    void vscode.window.showInformationMessage("gcc-robot: show an output first.");
    return;
  }
  const text = await vscode.window.showInputBox({
    title: `Options of ${found.shown.target}`,
    prompt: "As for gcc-robot build, without dashes",
    placeHolder: "decimals=3 interval=0.008",
    value: formatOptions(found.shown.options),
  });
  if (text !== undefined) await outputs.change(found.uri, parseOptions(text));
}

/** Diagnostic of the cursor's place, else the word there. */
function underCursor(): string {
  const editor = vscode.window.activeTextEditor;
  if (!editor) return "";
  const at = editor.selection.active;
  const found = vscode.languages
    .getDiagnostics(editor.document.uri)
    .find((d) => d.range.contains(at) || d.range.start.line === at.line);
  const code = found?.code;
  if (code !== undefined) return String(typeof code === "object" ? code.value : code);
  const word = editor.document.getWordRangeAtPosition(at);
  return word ? editor.document.getText(word) : "";
}

const EXPLAIN = "gcc-robot-explain";

/** Pages of diagnostics, codes and entities: `gcc-robot-explain:/E0203.md`. Names in STEP-NC files lead to them. */
class Explanations implements vscode.TextDocumentContentProvider {
  constructor(private readonly server: Server) {}
  async provideTextDocumentContent(uri: vscode.Uri): Promise<string> {
    const code = uri.path.replace(/^\//, "").replace(/\.md$/, "");
    return (await this.server.running()?.sendRequest(explain, { code }))?.markdown ?? "";
  }
}

async function explainCode(server: Server) {
  const client = server.running();
  if (!client) return;
  const code = await vscode.window.showInputBox({
    title: "Explain",
    prompt: "A diagnostic (E0203), a code (G83), a word (F) or an entity (PLANE_MILLING)",
    value: underCursor(),
  });
  if (!code) return;
  const { markdown } = await client.sendRequest(explain, { code: code.trim() });
  if (!markdown) {
    void vscode.window.showWarningMessage(`gcc-robot: nothing is known about ${code}.`);
    return;
  }
  const uri = vscode.Uri.from({ scheme: EXPLAIN, path: `/${code.trim()}.md` });
  await vscode.commands.executeCommand("markdown.showPreviewToSide", uri);
}

export function registerCommands(
  context: vscode.ExtensionContext,
  server: Server,
  previews: Previews,
  outputs: Outputs,
) {
  const pages = new Explanations(server);
  const pick = async (key: string, kind: "machines" | "dialects", title: string, none: string) => {
    const chosen = await choose(server, kind, title, none);
    if (chosen) await set(key, chosen.id);
  };
  const all: Record<string, () => unknown> = {
    preview: () => {
      const source = document();
      if (source) previews.open(source.uri);
    },
    build: () => build(context, server),
    output: () => showOutput(server, outputs),
    outputOptions: () => outputOptions(outputs),
    explain: () => explainCode(server),
    chooseMachine: () => pick("machine", "machines", "Machine or robot", "no machine: programs are checked alone"),
    chooseDialect: () => pick("dialect", "dialects", "Dialect", "by modeline, project and extension"),
    restart: () => server.start(),
  };
  context.subscriptions.push(vscode.workspace.registerTextDocumentContentProvider(EXPLAIN, pages));
  for (const [name, run] of Object.entries(all)) {
    context.subscriptions.push(vscode.commands.registerCommand(`gcc-robot.${name}`, run));
  }
}

/** Machine and dialect in the status bar. */
export function registerStatus(context: vscode.ExtensionContext) {
  const status = vscode.window.createStatusBarItem("gcc-robot.machine", vscode.StatusBarAlignment.Right, 90);
  status.name = "gcc-robot machine";
  status.command = "gcc-robot.chooseMachine";
  const show = () => {
    const editor = vscode.window.activeTextEditor;
    if (!editor || !LANGUAGES.includes(editor.document.languageId)) {
      status.hide();
      return;
    }
    const config = vscode.workspace.getConfiguration("gccRobot", editor.document.uri);
    status.text = `$(circuit-board) ${config.get<string>("machine") || "no machine"}`;
    status.tooltip = "Machine or robot that programs are checked for";
    status.show();
  };
  context.subscriptions.push(
    status,
    vscode.window.onDidChangeActiveTextEditor(show),
    vscode.workspace.onDidChangeConfiguration(show),
  );
  show();
}
