// `.stp` and `.step` are also drawings of products: those that hold a schema of machining become language `p21`.

import * as vscode from "vscode";

const SCHEMAS =
  /FILE_SCHEMA\s*\(\s*\(\s*'\s*(MACHINING_SCHEMA|MILLING_SCHEMA|TURNING_SCHEMA|COMBINED_SCHEMA|INTEGRATED_CNC_SCHEMA|MODEL_BASED_INTEGRATED_MANUFACTURING|AP238)/i;

export function isStepNc(text: string): boolean {
  return /^\s*ISO-10303-21\s*;/i.test(text) && SCHEMAS.test(text);
}

/** Characters of the header that are looked at. */
const HEADER = 8192;

function look(document: vscode.TextDocument) {
  if (document.languageId === "p21" || !/\.(stp|step)$/i.test(document.uri.path)) return;
  const start = document.getText(new vscode.Range(0, 0, 400, 0)).slice(0, HEADER);
  if (isStepNc(start)) void vscode.languages.setTextDocumentLanguage(document, "p21");
}

export function registerStepNc(context: vscode.ExtensionContext) {
  vscode.workspace.textDocuments.forEach(look);
  context.subscriptions.push(vscode.workspace.onDidOpenTextDocument(look));
}
