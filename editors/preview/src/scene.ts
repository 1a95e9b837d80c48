// The tool path as the server sends it (`gccRobot/preview`, docs/editor-features.md), and as typed arrays.

/** A tool change. */
export interface Tool {
  /** First point with this tool. */
  point: number;
  number: number;
  /** Diameter, mm. */
  diameter: number | null;
  comment: string;
  /** Line of the change, from 0. */
  line: number;
}

/** The machine along the path. */
export interface Machine {
  id: string;
  title: string;
  joints: string[];
  /** `deg` or `mm`, per joint. */
  units: string[];
  limits: [number | null, number | null][];
  /** Base, table and part in the frame of the path. */
  frames: { name: string; origin: Place; axes: [Place, Place, Place] }[];
  /** What is to be said about the joint values; may be empty. */
  note: string;
  /** Points of each line of the figure, and at every how many points of the path it is known. */
  figure: { lines: number[]; every: number };
}

export type Place = [number, number, number];

export type Box = [Place, Place];

/** Everything but the long lists. */
export interface Facts {
  uri: string;
  count: number;
  tools: Tool[];
  bounds: Box | null;
  cut: Box | null;
  stock: Box | null;
  seconds: number;
  rapidSeconds: number;
  cutLength: number;
  rapidLength: number;
  truncated: boolean;
  machine: Machine | null;
}

/** The answer of the server: long lists are base64 of little-endian numbers. */
export interface Answer extends Omit<Facts, "machine"> {
  version: number;
  key: string;
  unchanged: boolean;
  positions: string;
  kinds: string;
  lines: string;
  times: string;
  feeds: string;
  machine: (Omit<Machine, "figure"> & { values: string; figure: Machine["figure"] & { points: string } }) | null;
}

/** A path that can be drawn. Point `i` is joined to point `i - 1`, unless its kind is `JUMP`. */
export interface Scene extends Facts {
  /** X Y Z per point, mm. */
  positions: Float32Array;
  /** How each point is reached. */
  kinds: Uint8Array;
  /** Line of each point's block, from 0. */
  lines: Uint32Array;
  /** Seconds since the beginning, per point. */
  times: Float32Array;
  /** mm/min, per point; 0 for rapids. */
  feeds: Float32Array;
  /** Joint values, joints × points; NaN where the machine can't reach. */
  joints: Float32Array;
  /** Points of the machine's figures, X Y Z each; NaN where it can't be drawn. */
  figures: Float32Array;
}

export const JUMP = 255;

/** Names of the kinds, by number. */
export const KINDS = ["rapid", "feed", "arc", "probe, tap"];

function bytes(text: string): Uint8Array {
  const binary = atob(text);
  const out = new Uint8Array(binary.length);
  for (let i = 0; i < binary.length; i++) out[i] = binary.charCodeAt(i);
  return out;
}

// Typed arrays have the byte order of the processor; every one that runs a browser today is little-endian.
function floats(text: string): Float32Array {
  return new Float32Array(bytes(text).buffer);
}

/** Makes typed arrays of a server's answer. */
export function decode(answer: Answer): Scene {
  const { machine, ...facts } = answer;
  return {
    ...facts,
    machine: machine && { ...machine },
    positions: floats(answer.positions),
    kinds: bytes(answer.kinds),
    lines: new Uint32Array(bytes(answer.lines).buffer),
    times: floats(answer.times),
    feeds: floats(answer.feeds),
    joints: machine ? floats(machine.values) : new Float32Array(),
    figures: machine ? floats(machine.figure.points) : new Float32Array(),
  };
}

/** A scene without a path. */
export function nothing(): Scene {
  return {
    uri: "",
    count: 0,
    tools: [],
    bounds: null,
    cut: null,
    stock: null,
    seconds: 0,
    rapidSeconds: 0,
    cutLength: 0,
    rapidLength: 0,
    truncated: false,
    machine: null,
    positions: new Float32Array(),
    kinds: new Uint8Array(),
    lines: new Uint32Array(),
    times: new Float32Array(),
    feeds: new Float32Array(),
    joints: new Float32Array(),
    figures: new Float32Array(),
  };
}

/** The last point whose time is not after `seconds`. */
export function pointAt(scene: Scene, seconds: number): number {
  let low = 0;
  let high = scene.count - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (scene.times[middle] <= seconds) low = middle;
    else high = middle - 1;
  }
  return Math.max(low, 0);
}

/** Points whose segment comes from a line. */
export function pointsOf(scene: Scene, line: number): number[] {
  const found = [];
  for (let i = 0; i < scene.count; i++) {
    if (scene.lines[i] === line && i > 0 && scene.kinds[i] !== JUMP) found.push(i);
  }
  return found;
}

/** The last tool change at or before a point. */
export function toolAt(scene: Scene, point: number): Tool | undefined {
  return scene.tools.findLast((tool) => tool.point <= point);
}

/** The machine's figure at a point of the path: pairs of places, as lines are drawn; empty when it isn't known. */
export function figureAt(scene: Scene, point: number): Float32Array<ArrayBuffer> {
  const { lines, every } = scene.machine?.figure ?? { lines: [], every: 1 };
  const size = 3 * lines.reduce((sum, n) => sum + n, 0);
  const start = size * Math.round(point / every);
  const one = scene.figures.subarray(Math.min(start, scene.figures.length - size));
  if (!size || one.length < size || Number.isNaN(one[0])) return new Float32Array();
  const out: number[] = [];
  let at = 0;
  for (const n of lines) {
    for (let i = 0; i < n - 1; i++) out.push(...one.subarray(at + 3 * i, at + 3 * i + 6));
    at += 3 * n;
  }
  return Float32Array.from(out);
}
