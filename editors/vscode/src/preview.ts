// The tool path in a panel beside the text. The component is the one of `gcc-robot preview`.

import * as vscode from "vscode";
import { bytes, type Path, preview as request } from "./protocol";
import type { Server } from "./server";

/** How long the text rests before its path is asked for, ms: the server says itself when it is ready. */
const AGAIN = 30;

function nonce(): string {
  return Array.from(crypto.getRandomValues(new Uint8Array(16)), (b) => b.toString(16).padStart(2, "0")).join("");
}

/** Base64 becomes typed arrays, which go to the panel without being copied into text. */
function scene(path: Path) {
  const { machine, positions, kinds, lines, times, feeds, ...facts } = path;
  return {
    ...facts,
    machine,
    positions: new Float32Array(bytes(positions)),
    kinds: new Uint8Array(bytes(kinds)),
    lines: new Uint32Array(bytes(lines)),
    times: new Float32Array(bytes(times)),
    feeds: new Float32Array(bytes(feeds)),
    joints: machine ? new Float32Array(bytes(machine.values)) : new Float32Array(),
    figures: machine ? new Float32Array(bytes(machine.figure.points)) : new Float32Array(),
  };
}

class Panel {
  private key: string | undefined;
  private ready = false;
  private asking = false;
  private again = false;
  private timer: NodeJS.Timeout | undefined;

  constructor(
    readonly panel: vscode.WebviewPanel,
    readonly uri: vscode.Uri,
    private readonly server: Server,
    extension: vscode.Uri,
  ) {
    panel.webview.html = this.html(extension);
    panel.webview.onDidReceiveMessage((message: { ready?: boolean; choose?: number }) => {
      if (message.ready) {
        this.ready = true;
        this.key = undefined;
        this.refresh();
      }
      if (message.choose !== undefined) void this.show(message.choose);
    });
  }

  private html(extension: vscode.Uri): string {
    const { webview } = this.panel;
    const script = webview.asWebviewUri(vscode.Uri.joinPath(extension, "dist", "preview.js"));
    const once = nonce();
    return `<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; script-src 'nonce-${once}'; style-src 'nonce-${once}'">
<style nonce="${once}">html, body { margin: 0; padding: 0; height: 100%; overflow: hidden }</style>
</head>
<body>
<gcc-robot-preview></gcc-robot-preview>
<script nonce="${once}" src="${script}"></script>
</body>
</html>`;
  }

  /** Asks for the path soon; answers that are on their way are waited for. */
  refresh() {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => void this.ask(), AGAIN);
  }

  private async ask() {
    if (this.asking) {
      this.again = true;
      return;
    }
    const client = this.server.client;
    if (!client || !this.ready) return;
    this.asking = true;
    const config = vscode.workspace.getConfiguration("gccRobot.preview", this.uri);
    try {
      const path = await client.sendRequest(request, {
        textDocument: { uri: client.code2ProtocolConverter.asUri(this.uri) },
        have: this.key,
        tolerance: config.get<number>("tolerance") || undefined,
        mostPoints: config.get<number>("mostPoints"),
      });
      const title = vscode.workspace.asRelativePath(this.uri);
      if (!path.unchanged || this.key !== path.key) {
        await this.panel.webview.postMessage({ title, problem: "", scene: scene(path) });
        this.key = path.key;
        this.mark();
      }
    } catch (problem) {
      void this.panel.webview.postMessage({ problem: String((problem as Error).message ?? problem) });
    } finally {
      this.asking = false;
      if (this.again) {
        this.again = false;
        this.refresh();
      }
    }
  }

  /** Marks the line of the cursor. */
  mark() {
    const editor = vscode.window.visibleTextEditors.find((e) => e.document.uri.toString() === this.uri.toString());
    if (editor) void this.panel.webview.postMessage({ line: editor.selection.active.line });
  }

  /** Shows a line that was clicked in the picture. */
  private async show(line: number) {
    const open = vscode.window.visibleTextEditors.find((e) => e.document.uri.toString() === this.uri.toString());
    const editor = await vscode.window.showTextDocument(this.uri, {
      viewColumn: open?.viewColumn ?? vscode.ViewColumn.One,
    });
    const at = new vscode.Position(Math.min(line, editor.document.lineCount - 1), 0);
    editor.selection = new vscode.Selection(at, at);
    editor.revealRange(new vscode.Range(at, at), vscode.TextEditorRevealType.InCenterIfOutsideViewport);
  }

  dispose() {
    clearTimeout(this.timer);
  }
}

/** All panels, one per document. */
export class Previews {
  private readonly panels = new Map<string, Panel>();

  constructor(
    private readonly context: vscode.ExtensionContext,
    private readonly server: Server,
  ) {
    context.subscriptions.push(
      server.onAnalysed((uri) => this.panels.get(uri.toString())?.refresh()),
      vscode.window.onDidChangeTextEditorSelection((e) =>
        this.panels.get(e.textEditor.document.uri.toString())?.mark(),
      ),
      vscode.workspace.onDidChangeConfiguration((e) => {
        if (e.affectsConfiguration("gccRobot")) for (const panel of this.panels.values()) panel.refresh();
      }),
    );
  }

  open(uri: vscode.Uri) {
    const known = this.panels.get(uri.toString());
    if (known) {
      known.panel.reveal(undefined, true);
      return;
    }
    const name = uri.path.split("/").pop();
    const view = { viewColumn: vscode.ViewColumn.Beside, preserveFocus: true };
    const panel = vscode.window.createWebviewPanel("gccRobotPreview", `Tool path: ${name}`, view, {
      enableScripts: true,
      localResourceRoots: [vscode.Uri.joinPath(this.context.extensionUri, "dist")],
    });
    const made = new Panel(panel, uri, this.server, this.context.extensionUri);
    this.panels.set(uri.toString(), made);
    panel.onDidDispose(() => {
      made.dispose();
      this.panels.delete(uri.toString());
    });
  }
}
