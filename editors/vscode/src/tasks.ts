// Tasks of type `gcc-robot`: building and checking, with a problem matcher.

import * as vscode from "vscode";
import { program } from "./server";

export interface Definition extends vscode.TaskDefinition {
  command: "build" | "check";
  file?: string;
  target?: string;
  output?: string;
  args?: string[];
}

function command(definition: Definition): string[] {
  const options = ["--message-format", "short", definition.command];
  if (definition.file) options.push(definition.file);
  if (definition.target) options.push("--target", definition.target);
  if (definition.output) options.push("-o", definition.output);
  return [...options, ...(definition.args ?? [])];
}

export function task(
  context: vscode.ExtensionContext,
  definition: Definition,
  scope: vscode.WorkspaceFolder | undefined,
): vscode.Task {
  const name = [
    definition.command,
    definition.target,
    definition.file && vscode.workspace.asRelativePath(definition.file),
  ];
  const run = new vscode.ProcessExecution(program(context) ?? "gcc-robot", command(definition));
  const made = new vscode.Task(
    definition,
    scope ?? vscode.TaskScope.Workspace,
    name.filter(Boolean).join(" "),
    "gcc-robot",
    run,
    "$gcc-robot",
  );
  made.group = definition.command === "build" ? vscode.TaskGroup.Build : undefined;
  made.presentationOptions = { reveal: vscode.TaskRevealKind.Silent, clear: true };
  return made;
}

export function registerTasks(context: vscode.ExtensionContext) {
  const provider: vscode.TaskProvider = {
    async provideTasks() {
      const projects = await vscode.workspace.findFiles("**/gcc-robot.toml", "**/node_modules/**", 20);
      return projects.map((project) => {
        const folder = vscode.Uri.joinPath(project, "..").fsPath;
        const made = task(
          context,
          { type: "gcc-robot", command: "build", args: ["--project", folder] },
          vscode.workspace.getWorkspaceFolder(project),
        );
        made.name = `build ${vscode.workspace.asRelativePath(project)}`;
        return made;
      });
    },
    resolveTask(given) {
      const definition = given.definition as Definition;
      return definition.command ? task(context, definition, given.scope as vscode.WorkspaceFolder) : undefined;
    },
  };
  context.subscriptions.push(vscode.tasks.registerTaskProvider("gcc-robot", provider));
}
