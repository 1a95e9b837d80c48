// Connects the component to what it lives in: a VS Code webview, a served page, or a page with its own data.

import { Preview } from "./preview";
import { type Answer, decode, type Scene } from "./scene";

interface VsCode {
  postMessage(message: unknown): void;
  setState(state: unknown): void;
  getState(): { line?: number } | undefined;
}
declare const acquireVsCodeApi: undefined | (() => VsCode);

/** A page's own data; `text` is the program. */
interface Page {
  title: string;
  path?: Answer;
  text?: string;
  /** Served: the rest comes from the server. */
  served?: boolean;
}

customElements.define("gcc-robot-preview", Preview);

function start() {
  const preview = document.querySelector<Preview>("gcc-robot-preview");
  if (!preview) return;
  if (typeof acquireVsCodeApi === "function") webview(preview, acquireVsCodeApi());
  else page(preview);
}

/** The extension sends typed arrays and lines, and is sent chosen lines. */
function webview(preview: Preview, code: VsCode) {
  window.addEventListener("message", (event) => {
    const message = event.data as { scene?: Scene; line?: number; title?: string; problem?: string };
    if (message.title !== undefined) preview.heading = message.title;
    if (message.problem !== undefined) preview.problem = message.problem;
    if (message.scene) preview.setScene(message.scene);
    if (message.line !== undefined) preview.line = message.line;
  });
  preview.addEventListener("choose", (event) => {
    code.postMessage({ choose: (event as CustomEvent<{ line: number }>).detail.line });
  });
  code.postMessage({ ready: true });
}

function page(preview: Preview) {
  const embedded = document.querySelector('script[type="application/json"]')?.textContent;
  const data = JSON.parse(embedded ?? "{}") as Page;
  preview.heading = data.title ?? "";
  if (data.text !== undefined) preview.setText(data.text);
  if (data.path) preview.setScene(decode(data.path));
  if (data.served) served(preview);
}

/** `gcc-robot preview --serve`: news come as events, chosen lines go back. Addresses are relative to the page's. */
function served(preview: Preview) {
  const load = async () => {
    const answer = await fetch("path");
    if (!answer.ok) return;
    const news = (await answer.json()) as Page & { problem?: string };
    preview.problem = news.problem ?? "";
    if (news.text !== undefined) preview.setText(news.text);
    if (news.path) preview.setScene(decode(news.path));
  };
  const events = new EventSource("events");
  events.onmessage = (event) => {
    const message = JSON.parse(event.data) as { line?: number; changed?: boolean };
    if (message.line !== undefined) preview.line = message.line;
    if (message.changed) void load();
  };
  events.onopen = () => {
    preview.problem = "";
    void load();
  };
  events.onerror = () => {
    preview.problem = "gcc-robot has ended; the picture is the last one";
  };
  preview.addEventListener("choose", (event) => {
    void fetch("choose", { method: "POST", body: String((event as CustomEvent<{ line: number }>).detail.line) });
  });
}

start();
