// Requests of the server's own (docs/editor-features.md).

import { NotificationType, RequestType, RequestType0 } from "vscode-languageclient/node";

interface Document {
  textDocument: { uri: string };
}

/** A tool path; long lists are base64 of little-endian numbers. */
export interface Path {
  uri: string;
  version: number;
  key: string;
  unchanged: boolean;
  count: number;
  positions: string;
  kinds: string;
  lines: string;
  times: string;
  feeds: string;
  machine: { values: string; figure: { points: string } } | null;
}

export const preview = new RequestType<
  Document & { have?: string; tolerance?: number; mostPoints?: number },
  Path,
  void
>("gccRobot/preview");

/** What a target makes of a document. */
export interface Output {
  files: { name: string; text: string; base64: string | null; lines: string }[];
  diagnostics: { range: { start: { line: number } }; severity?: number; message: string }[];
  error: string | null;
}

export const output = new RequestType<
  Document & { target: string; options: Record<string, unknown>; machine?: string },
  Output,
  void
>("gccRobot/output");

/** The settings as options of `gcc-robot build`, so that what is built is what is shown. */
export const buildOptions = new RequestType<Document, { options: string[] }, void>("gccRobot/buildOptions");

/** Something that can be chosen. */
export interface Choice {
  id: string;
  title: string;
  detail: string;
  extension: string;
  status: string;
  options: string[];
}

export const choices = new RequestType0<{ targets: Choice[]; machines: Choice[]; dialects: Choice[] }, void>(
  "gccRobot/targets",
);

export const explain = new RequestType<{ code: string; dialect?: string }, { markdown: string | null }, void>(
  "gccRobot/explain",
);

export const analysed = new NotificationType<{ uri: string; version: number }>("gccRobot/analysed");

/** Bytes of base64, in a buffer of their own. */
export function bytes(text: string): ArrayBuffer {
  const shared = Buffer.from(text, "base64");
  return shared.buffer.slice(shared.byteOffset, shared.byteOffset + shared.byteLength) as ArrayBuffer;
}
