// Colours of the two themes. Those of the light one are the colours of the pictures that `gcc-robot` draws.

import type { Color } from "./renderer";

export interface Theme {
  background: Color;
  /** Rapid, feed, arc, probe or tap. */
  kinds: Color[];
  faint: Color;
  mark: Color;
  stock: Color;
  machine: Color;
  axes: [Color, Color, Color];
  tool: Color;
  measure: Color;
  text: string;
}

const rgb = (r: number, g: number, b: number): Color => [r / 255, g / 255, b / 255];

export const LIGHT: Theme = {
  background: rgb(255, 255, 255),
  kinds: [rgb(226, 119, 38), rgb(24, 92, 190), rgb(15, 146, 106), rgb(158, 54, 160)],
  faint: rgb(216, 220, 228),
  mark: rgb(214, 20, 60),
  stock: rgb(150, 140, 120),
  machine: rgb(110, 118, 135),
  axes: [rgb(200, 40, 40), rgb(30, 130, 50), rgb(40, 70, 200)],
  tool: rgb(40, 44, 52),
  measure: rgb(90, 40, 160),
  text: "#282c34",
};

export const DARK: Theme = {
  background: rgb(30, 32, 38),
  kinds: [rgb(240, 150, 70), rgb(97, 160, 255), rgb(70, 205, 150), rgb(220, 120, 220)],
  faint: rgb(66, 70, 80),
  mark: rgb(255, 90, 120),
  stock: rgb(140, 130, 110),
  machine: rgb(165, 172, 190),
  axes: [rgb(235, 90, 90), rgb(90, 200, 110), rgb(110, 140, 255)],
  tool: rgb(230, 230, 235),
  measure: rgb(200, 160, 255),
  text: "#d7dae0",
};

export function css(color: Color): string {
  return `rgb(${color.map((v) => Math.round(v * 255)).join(" ")})`;
}
