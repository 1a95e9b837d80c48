// What a target makes of a document, live beside it: a read-only document whose lines know where they come from.

import * as vscode from "vscode";
import { bytes, type Output, output as request } from "./protocol";
import type { Server } from "./server";

export const SCHEME = "gcc-robot-output";
const NONE = 4294967295;

/** Languages of what targets write, by the extension of the file. */
const LANGUAGE: Record<string, string> = {
  ngc: "gcode",
  nc: "gcode",
  tap: "gcode",
  gc: "gcode",
  g: "gcode",
  p21: "p21",
  json: "json",
  html: "html",
  csv: "plaintext",
};

/** One shown output. */
interface Shown {
  source: vscode.Uri;
  target: string;
  options: Record<string, unknown>;
  text: string;
  /** Line of the source, per line. */
  lines: Uint32Array;
}

/** `decimals=3 interval=0.008` as an object. */
export function parseOptions(text: string): Record<string, unknown> {
  const options: Record<string, unknown> = {};
  for (const word of text.split(/\s+/).filter(Boolean)) {
    const [key, value] = word.replace(/^-+/, "").split("=");
    options[key] = value === undefined ? true : value !== "" && Number.isFinite(Number(value)) ? Number(value) : value;
  }
  return options;
}

export function formatOptions(options: Record<string, unknown>): string {
  return Object.entries(options)
    .map(([key, value]) => (value === true ? key : `${key}=${value}`))
    .join(" ");
}

function problems(answer: Output): string {
  if (answer.error) return `; ${answer.error}\n`;
  const errors = answer.diagnostics.filter((d) => (d.severity ?? 1) === 1);
  const rows = errors.map((d) => `; line ${d.range.start.line + 1}: ${d.message.split("\n")[0]}`);
  return ["; errors keep this from being made:", ...rows, ""].join("\n");
}

export class Outputs implements vscode.TextDocumentContentProvider {
  private readonly shown = new Map<string, Shown>();
  private readonly changed = new vscode.EventEmitter<vscode.Uri>();
  readonly onDidChange = this.changed.event;
  private readonly mark = vscode.window.createTextEditorDecorationType({
    isWholeLine: true,
    backgroundColor: new vscode.ThemeColor("editor.rangeHighlightBackground"),
    overviewRulerColor: new vscode.ThemeColor("editorOverviewRuler.rangeHighlightForeground"),
  });

  constructor(
    context: vscode.ExtensionContext,
    private readonly server: Server,
  ) {
    context.subscriptions.push(
      this.mark,
      server.onAnalysed((uri) => void this.refresh(uri)),
      vscode.workspace.registerTextDocumentContentProvider(SCHEME, this),
      vscode.window.onDidChangeTextEditorSelection((e) => this.follow(e)),
      vscode.workspace.onDidCloseTextDocument((d) => this.shown.delete(d.uri.toString())),
    );
  }

  provideTextDocumentContent(uri: vscode.Uri): string {
    return this.shown.get(uri.toString())?.text ?? "";
  }

  /** The output that belongs to a document, shown or its source. */
  of(uri: vscode.Uri | undefined): { uri: vscode.Uri; shown: Shown } | undefined {
    for (const [key, shown] of this.shown) {
      if (key === uri?.toString() || shown.source.toString() === uri?.toString())
        return { uri: vscode.Uri.parse(key), shown };
    }
    return undefined;
  }

  async show(source: vscode.Uri, target: string, options: Record<string, unknown>) {
    const shown: Shown = { source, target, options, text: "", lines: new Uint32Array() };
    const file = await this.make(shown);
    if (!file) return;
    const name = file.name || `${source.path.split("/").pop()}.${target}`;
    const uri = vscode.Uri.from({ scheme: SCHEME, path: `/${name}`, query: `${target}&${source.toString()}` });
    this.shown.set(uri.toString(), shown);
    this.changed.fire(uri);
    const document = await vscode.workspace.openTextDocument(uri);
    const language = LANGUAGE[name.split(".").pop()?.toLowerCase() ?? ""];
    if (language) await vscode.languages.setTextDocumentLanguage(document, language);
    await vscode.window.showTextDocument(document, {
      viewColumn: vscode.ViewColumn.Beside,
      preserveFocus: true,
      preview: false,
    });
  }

  async change(uri: vscode.Uri, options: Record<string, unknown>) {
    const shown = this.shown.get(uri.toString());
    if (!shown) return;
    shown.options = options;
    await this.make(shown);
    this.changed.fire(uri);
  }

  private async make(shown: Shown): Promise<{ name: string } | undefined> {
    const client = this.server.running();
    if (!client) return undefined;
    try {
      const answer = await client.sendRequest(request, {
        textDocument: { uri: client.code2ProtocolConverter.asUri(shown.source) },
        target: shown.target,
        options: shown.options,
      });
      const file = answer.files[0];
      shown.text = file ? (file.base64 ? "; a picture: build it to see it\n" : file.text) : problems(answer);
      shown.lines = file ? new Uint32Array(bytes(file.lines)) : new Uint32Array();
      return { name: file?.name ?? "" };
    } catch (problem) {
      void vscode.window.showErrorMessage(`gcc-robot: ${(problem as Error).message}`);
      return undefined;
    }
  }

  private async refresh(source: vscode.Uri) {
    for (const [key, shown] of this.shown) {
      if (shown.source.toString() !== source.toString()) continue;
      await this.make(shown);
      this.changed.fire(vscode.Uri.parse(key));
    }
  }

  /** The cursor's line and those that belong to it on the other side. */
  private follow(event: vscode.TextEditorSelectionChangeEvent) {
    const here = event.textEditor.document.uri.toString();
    const line = event.selections[0].active.line;
    for (const [key, shown] of this.shown) {
      if (shown.source.toString() === here) {
        const found: number[] = [];
        shown.lines.forEach((from, i) => {
          if (from === line) found.push(i);
        });
        this.point(key, found);
      } else if (key === here) {
        const from = shown.lines[line];
        this.point(shown.source.toString(), from === undefined || from === NONE ? [] : [from]);
      }
    }
  }

  private point(uri: string, lines: number[]) {
    const editor = vscode.window.visibleTextEditors.find((e) => e.document.uri.toString() === uri);
    if (!editor) return;
    const ranges = lines.slice(0, 10_000).map((l) => new vscode.Range(l, 0, l, 0));
    editor.setDecorations(this.mark, ranges);
    if (ranges[0]) editor.revealRange(ranges[0], vscode.TextEditorRevealType.InCenterIfOutsideViewport);
  }
}
