// Lines with WebGL 2. The path is one strip; a segment has the kind of its end point (`flat`, so the last
// vertex counts). A large path is drawn off screen, over several frames while the page stays alive, and copied when
// it is complete.

import { BUDGET, levels } from "./lod";
import type { Scene } from "./scene";

export type Color = [number, number, number];

const VERTEX = `#version 300 es
layout(location = 0) in vec3 place;
layout(location = 1) in uint kind;
uniform mat4 view;
uniform vec2 shift;
uniform vec3 colors[8];
uniform uint shown;
uniform vec4 only;
flat out vec4 color;
void main() {
  vec4 p = view * vec4(place, 1.0);
  gl_Position = vec4(p.xy + shift, clamp(p.z, -1.0, 1.0), 1.0);
  bool hidden = kind > 7u || (shown & (1u << kind)) == 0u;
  color = only.a > 0.0 ? vec4(only.rgb, kind > 7u ? 0.0 : 1.0) : vec4(colors[min(kind, 7u)], hidden ? 0.0 : 1.0);
}`;

const FRAGMENT = `#version 300 es
precision mediump float;
flat in vec4 color;
out vec4 paint;
void main() {
  if (color.a < 0.5) discard;
  paint = color;
}`;

/** What a picture is made of. */
export interface Picture {
  matrix: Float32Array;
  background: Color;
  /** Per kind. */
  colors: Color[];
  /** Bit set: kinds that are shown. */
  shown: number;
  /** Points before this one are drawn in full colour, the rest is faint. */
  until: number;
  faint: Color;
  /** Marked segments: pairs of places. */
  marked: Float32Array;
  mark: Color;
  /** Further lines: pairs of places and their colour. */
  extras: { places: Float32Array; color: Color }[];
}

/** What was drawn last. */
export interface Drawn {
  /** Segments of the path. */
  segments: number;
  /** The whole path, not a reduced one. */
  whole: boolean;
}

function shader(gl: WebGL2RenderingContext, type: number, source: string): WebGLShader {
  const made = gl.createShader(type);
  if (!made) throw new Error("the graphics context is lost");
  gl.shaderSource(made, source);
  gl.compileShader(made);
  if (!gl.getShaderParameter(made, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(made) ?? "shader");
  return made;
}

export class Renderer {
  readonly gl: WebGL2RenderingContext;
  /** Name of the graphics hardware or of the program that stands in for it. */
  readonly device: string;
  drawn: Drawn = { segments: 0, whole: true };
  private readonly uniforms: Record<string, WebGLUniformLocation | null> = {};
  private readonly path: WebGLVertexArrayObject;
  private readonly extra: WebGLVertexArrayObject;
  private readonly places: WebGLBuffer;
  private readonly kinds: WebGLBuffer;
  private readonly reduced: WebGLVertexArrayObject;
  private readonly reducedPlaces: WebGLBuffer;
  private readonly reducedKinds: WebGLBuffer;
  private readonly extraPlaces: WebGLBuffer;
  private readonly target: WebGLFramebuffer;
  private readonly paint: WebGLRenderbuffer;
  private readonly depth: WebGLRenderbuffer;
  private readonly samples: number;
  private size = [0, 0];
  private count = 0;
  /**
   * Points that are drawn while the camera moves, finest first. Their places stand one after the other in buffers of
   * their own: an index buffer over the whole path costs a software renderer many times as much.
   */
  private levels: Uint32Array[] = [];
  private level = 0;
  private lastQuick = 0;
  private waiting = 0;
  /** The picture is drawn off screen and copied when it is complete. */
  private aside = true;
  private step = BUDGET;

  constructor(readonly canvas: HTMLCanvasElement) {
    const gl = canvas.getContext("webgl2", { antialias: false, powerPreference: "high-performance" });
    if (!gl) throw new Error("this browser has no WebGL 2");
    this.gl = gl;
    const info = gl.getExtension("WEBGL_debug_renderer_info");
    this.device = String(info ? gl.getParameter(info.UNMASKED_RENDERER_WEBGL) : gl.getParameter(gl.RENDERER));
    // Smooth lines cost a processor that stands in for graphics hardware four times the work.
    const software = /swiftshader|llvmpipe|software/i.test(this.device);
    this.samples = software ? 0 : Math.min(4, gl.getParameter(gl.MAX_SAMPLES));
    const program = gl.createProgram();
    gl.attachShader(program, shader(gl, gl.VERTEX_SHADER, VERTEX));
    gl.attachShader(program, shader(gl, gl.FRAGMENT_SHADER, FRAGMENT));
    gl.linkProgram(program);
    gl.useProgram(program);
    for (const name of ["view", "shift", "colors", "shown", "only"]) {
      this.uniforms[name] = gl.getUniformLocation(program, name);
    }
    this.path = gl.createVertexArray();
    this.extra = gl.createVertexArray();
    this.places = gl.createBuffer();
    this.kinds = gl.createBuffer();
    this.reduced = gl.createVertexArray();
    this.reducedPlaces = gl.createBuffer();
    this.reducedKinds = gl.createBuffer();
    this.extraPlaces = gl.createBuffer();
    this.target = gl.createFramebuffer();
    this.paint = gl.createRenderbuffer();
    this.depth = gl.createRenderbuffer();
    this.attributes(this.path, this.places, this.kinds);
    this.attributes(this.reduced, this.reducedPlaces, this.reducedKinds);
    this.attributes(this.extra, this.extraPlaces, null);
  }

  private attributes(array: WebGLVertexArrayObject, places: WebGLBuffer, kinds: WebGLBuffer | null) {
    const gl = this.gl;
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, places);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    if (!kinds) return;
    gl.bindBuffer(gl.ARRAY_BUFFER, kinds);
    gl.enableVertexAttribArray(1);
    gl.vertexAttribIPointer(1, 1, gl.UNSIGNED_BYTE, 0, 0);
  }

  /** Takes a path to the graphics hardware. */
  load(scene: Scene) {
    const gl = this.gl;
    this.stop();
    this.count = scene.count;
    this.levels = levels(scene);
    this.level = Math.min(this.level, Math.max(this.levels.length - 1, 0));
    gl.bindBuffer(gl.ARRAY_BUFFER, this.places);
    gl.bufferData(gl.ARRAY_BUFFER, scene.positions, gl.STATIC_DRAW);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.kinds);
    gl.bufferData(gl.ARRAY_BUFFER, scene.kinds, gl.STATIC_DRAW);
    const total = this.levels.reduce((sum, level) => sum + level.length, 0);
    const places = new Float32Array(3 * total);
    const kinds = new Uint8Array(total);
    let n = 0;
    for (const level of this.levels) {
      for (const i of level) {
        places.set(scene.positions.subarray(3 * i, 3 * i + 3), 3 * n);
        kinds[n++] = scene.kinds[i];
      }
    }
    gl.bindBuffer(gl.ARRAY_BUFFER, this.reducedPlaces);
    gl.bufferData(gl.ARRAY_BUFFER, places, gl.STATIC_DRAW);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.reducedKinds);
    gl.bufferData(gl.ARRAY_BUFFER, kinds, gl.STATIC_DRAW);
  }

  /** Makes the drawing surface as large as the canvas is shown. */
  resize(width: number, height: number) {
    if (this.size[0] === width && this.size[1] === height) return;
    const gl = this.gl;
    this.size = [width, height];
    this.canvas.width = width;
    this.canvas.height = height;
    gl.bindRenderbuffer(gl.RENDERBUFFER, this.paint);
    gl.renderbufferStorageMultisample(gl.RENDERBUFFER, this.samples, gl.RGBA8, width, height);
    gl.bindRenderbuffer(gl.RENDERBUFFER, this.depth);
    gl.renderbufferStorageMultisample(gl.RENDERBUFFER, this.samples, gl.DEPTH_COMPONENT24, width, height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.target);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.RENDERBUFFER, this.paint);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, this.depth);
  }

  private stop() {
    cancelAnimationFrame(this.waiting);
    this.waiting = 0;
  }

  /** A quick picture: at most `BUDGET` segments. Returns whether it shows the whole path. */
  quick(picture: Picture, now: number): boolean {
    this.stop();
    // Without smoothing there is no need to draw elsewhere first.
    this.begin(picture, this.samples === 0 ? null : this.target);
    const whole = this.levels.length === 0;
    if (whole) {
      this.strip(picture, 0, this.count);
    } else {
      this.adapt(now);
      this.thin(picture);
    }
    this.finish(picture, (whole ? this.count : this.levels[this.level].length) - 1, whole);
    return whole;
  }

  /** Fewer segments when frames of a movement come late, more when they come early. */
  private adapt(now: number) {
    const passed = now - this.lastQuick;
    this.lastQuick = now;
    const coarser = passed > 200 ? 3 : passed > 100 ? 2 : 1;
    // After more than a second it is another movement.
    if (passed > 50 && passed < 1000) this.level = Math.min(this.level + coarser, this.levels.length - 1);
    else if (passed < 18 && passed > 0) this.level = Math.max(this.level - 1, 0);
  }

  /** The whole path, a part of it per frame. */
  whole(picture: Picture, done: () => void) {
    this.stop();
    this.begin(picture, this.target);
    let from = 0;
    let last = 0;
    const next = (now: number) => {
      // A frame that came in time means that the hardware can take more.
      if (last && now - last < 20) this.step = Math.min(this.step * 2, 4_000_000);
      else if (last && now - last > 120) this.step = Math.max(this.step / 2, BUDGET / 2);
      last = now;
      this.gl.bindFramebuffer(this.gl.FRAMEBUFFER, this.target);
      const to = Math.min(this.count, from + Math.floor(this.step));
      this.strip(picture, from, to);
      from = to;
      if (from < this.count) {
        this.gl.flush();
        this.waiting = requestAnimationFrame(next);
      } else {
        this.waiting = 0;
        this.finish(picture, this.count - 1, true);
        done();
      }
    };
    this.waiting = requestAnimationFrame(next);
  }

  private begin(picture: Picture, target: WebGLFramebuffer | null) {
    const gl = this.gl;
    this.aside = target !== null;
    gl.bindFramebuffer(gl.FRAMEBUFFER, target);
    gl.viewport(0, 0, this.size[0], this.size[1]);
    gl.clearColor(...picture.background, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.uniformMatrix4fv(this.uniforms.view, false, picture.matrix);
    gl.uniform2f(this.uniforms.shift, 0, 0);
    gl.uniform1ui(this.uniforms.shown, picture.shown);
    gl.uniform4f(this.uniforms.only, 0, 0, 0, 0);
    gl.uniform3fv(this.uniforms.colors, picture.colors.flat());
  }

  /** All colours become faint ones, as far as they are of the path that is still to come. */
  private shade(picture: Picture, faint: boolean) {
    const colors = faint ? picture.colors.map(() => picture.faint) : picture.colors;
    this.gl.uniform3fv(this.uniforms.colors, colors.flat());
  }

  /** Points `from` … `to` - 1 with the segment that leads to the first one. */
  private strip(picture: Picture, from: number, to: number) {
    const gl = this.gl;
    gl.bindVertexArray(this.path);
    const draw = (a: number, b: number) => {
      const first = Math.max(a - 1, 0);
      if (b - first > 1) gl.drawArrays(gl.LINE_STRIP, first, b - first);
    };
    const border = Math.min(Math.max(picture.until, from), to);
    this.shade(picture, false);
    draw(from, border);
    if (border < to) {
      this.shade(picture, true);
      draw(border, to);
    }
  }

  /** The reduced path. */
  private thin(picture: Picture) {
    const gl = this.gl;
    const chosen = this.levels[this.level];
    const offset = this.levels.slice(0, this.level).reduce((sum, l) => sum + l.length, 0);
    gl.bindVertexArray(this.reduced);
    let border = chosen.length;
    if (picture.until < this.count) {
      border = 0;
      while (border < chosen.length && chosen[border] < picture.until) border++;
    }
    const draw = (a: number, b: number) => {
      const first = Math.max(a - 1, 0);
      if (b - first > 1) gl.drawArrays(gl.LINE_STRIP, offset + first, b - first);
    };
    this.shade(picture, false);
    draw(0, border);
    if (border < chosen.length) {
      this.shade(picture, true);
      draw(border, chosen.length);
    }
  }

  /** Marks and extras, and the copy to the screen. */
  private finish(picture: Picture, segments: number, whole: boolean) {
    const gl = this.gl;
    for (const extra of picture.extras) this.lines(extra.places, extra.color);
    this.mark(picture);
    if (this.aside) {
      gl.bindFramebuffer(gl.READ_FRAMEBUFFER, this.target);
      gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, null);
      const [w, h] = this.size;
      gl.blitFramebuffer(0, 0, w, h, 0, 0, w, h, gl.COLOR_BUFFER_BIT, gl.NEAREST);
    }
    this.drawn = { segments: Math.max(segments, 0), whole };
  }

  private lines(places: Float32Array, color: Color) {
    const gl = this.gl;
    gl.bindVertexArray(this.extra);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.extraPlaces);
    gl.bufferData(gl.ARRAY_BUFFER, places, gl.STREAM_DRAW);
    gl.vertexAttribI4ui(1, 0, 0, 0, 0);
    gl.uniform4f(this.uniforms.only, ...color, 1);
    gl.drawArrays(gl.LINES, 0, places.length / 3);
    gl.uniform4f(this.uniforms.only, 0, 0, 0, 0);
  }

  /** Marked segments are three pixels wide and never hidden. */
  private mark(picture: Picture) {
    if (picture.marked.length === 0) return;
    const gl = this.gl;
    gl.disable(gl.DEPTH_TEST);
    for (const [x, y] of [
      [0, 0],
      [1, 0],
      [-1, 0],
      [0, 1],
      [0, -1],
    ]) {
      gl.uniform2f(this.uniforms.shift, (2 * x) / this.size[0], (2 * y) / this.size[1]);
      this.lines(picture.marked, picture.mark);
    }
    gl.uniform2f(this.uniforms.shift, 0, 0);
  }
}
