// A viewer of folding sheets in WebGL 2: every <figure class="viewer"> holds its data. Part of origami_sim, Apache-2.0.
"use strict";
(() => {
  const SURFACE = [`#version 300 es
    in vec3 at; in vec3 colour; uniform mat4 view; out vec3 shade; out vec3 place;
    void main() { gl_Position = view * vec4(at, 1.0); shade = colour; place = at; }`,
  `#version 300 es
    precision highp float; in vec3 shade; in vec3 place; uniform float flat_; out vec4 pixel;
    void main() {
      vec3 n = normalize(cross(dFdx(place), dFdy(place)));
      float light = mix(0.62 + 0.38 * abs(dot(n, normalize(vec3(0.35, -0.5, 0.79)))), 1.0, flat_);
      pixel = vec4(shade * light, 1.0);
    }`];
  const LINE = [`#version 300 es
    in vec3 at; in vec3 other; in float side; in vec3 colour; uniform mat4 view; uniform vec2 half_; uniform float width;
    uniform float nearer; out vec3 shade;
    void main() {
      vec4 a = view * vec4(at, 1.0), b = view * vec4(other, 1.0);
      vec2 along = normalize((b.xy / b.w - a.xy / a.w) * half_ + vec2(1e-9, 0.0));
      a.xy += side * width * vec2(-along.y, along.x) / half_ * a.w;
      a.z += nearer; gl_Position = a; shade = colour;
    }`,
  `#version 300 es
    precision highp float; in vec3 shade; out vec4 pixel; void main() { pixel = vec4(shade, 1.0); }`];
  const INK = [60, 66, 74], FOCAL = 3.2;

  function program(gl, [vertex, fragment]) {
    const p = gl.createProgram();
    for (const [kind, code] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const s = gl.createShader(kind);
      gl.shaderSource(s, code); gl.compileShader(s); gl.attachShader(p, s);
    }
    gl.linkProgram(p);
    if (!gl.getProgramParameter(p, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(p));
    return p;
  }

  const bytes = text => Uint8Array.from(atob(text), c => c.charCodeAt(0));
  const sub = (a, b) => a.map((v, i) => v - b[i]), add = (a, b, k = 1) => a.map((v, i) => v + k * b[i]);
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const unit = a => { const n = Math.hypot(...a) || 1; return a.map(v => v / n); };

  // columns of projection times view, as WebGL wants them
  function matrix(eye, target, aspect, near, far) {
    const back = unit(sub(eye, target)), right = unit(cross([0, 0, 1], back)), up = cross(back, right), f = FOCAL;
    const m = [[...right, -dot(right, eye)], [...up, -dot(up, eye)], [...back, -dot(back, eye)]];
    const fx = f / Math.max(1, aspect), fy = f * Math.min(1, aspect), z = (far + near) / (near - far);
    const rows = [m[0].map(v => v * fx), m[1].map(v => v * fy),
      m[2].map((v, i) => z * v + (i === 3 ? 2 * far * near / (near - far) : 0)), m[2].map(v => -v)];
    return new Float32Array([0, 1, 2, 3].flatMap(c => rows.map(r => r[c])));
  }

  // triangles of an arrow, as positions
  function arrow(from, vector, radius, out) {
    const length = Math.hypot(...vector);
    if (length < 3 * radius) return;
    const along = unit(vector), one = unit(cross(along, Math.abs(along[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0]));
    const two = cross(along, one), head = Math.min(5 * radius, length / 2), neck = add(from, along, length - head);
    const tip = add(from, vector), n = 8;
    const ring = (at, r, k) => add(add(at, one, r * Math.cos(2 * Math.PI * k / n)), two, r * Math.sin(2 * Math.PI * k / n));
    for (let k = 0; k < n; k++) {
      const a = ring(from, radius, k), b = ring(from, radius, k + 1), c = ring(neck, radius, k), d = ring(neck, radius, k + 1);
      const e = ring(neck, 2.4 * radius, k), g = ring(neck, 2.4 * radius, k + 1);
      out.push(...a, ...b, ...c, ...b, ...d, ...c, ...e, ...g, ...tip, ...g, ...e, ...neck);
    }
  }

  class Viewer {
    constructor(figure) {
      this.canvas = figure.querySelector("canvas");
      this.button = figure.querySelector("button");
      this.slider = figure.querySelector("input");
      this.output = figure.querySelector("output");
      this.d = JSON.parse(figure.querySelector("script").textContent);
      this.x = new Uint16Array(bytes(this.d.x).buffer);
      this.folds = bytes(this.d.folds);
      this.gl = this.canvas.getContext("webgl2", { antialias: true });
      if (!this.gl) {
        this.canvas.replaceWith("This browser draws no WebGL 2; the moving picture shows the same.");
        figure.querySelector(".bar").remove();
        return;
      }
      const gl = this.gl, d = this.d;
      this.surface = program(gl, SURFACE); this.line = program(gl, LINE);
      this.buffers = {};
      this.turn = d.across === 0 ? -1.11 : 0.46; this.tilt = 0.46;
      this.target = d.box[0].map((v, i) => (v + d.box[1][i]) / 2);
      this.walks = Math.hypot(...sub(d.box[1], d.box[0])) > 3 * d.size;
      this.radius = this.walks ? 0.9 * d.size : 0.5 * Math.hypot(...sub(d.box[1], d.box[0])) + 0.15 * d.size;
      this.distance = 2.6 * this.radius;
      this.time = 0; this.playing = !matchMedia("(prefers-reduced-motion: reduce)").matches;
      this.visible = false; this.listen();
      new IntersectionObserver(seen => { this.visible = seen[0].isIntersecting; this.wake(); }).observe(this.canvas);
      new ResizeObserver(() => this.wake()).observe(this.canvas);
    }

    listen() {
      const c = this.canvas, fingers = new Map();
      this.button.onclick = () => { this.playing = !this.playing; this.wake(); };
      this.slider.oninput = () => { this.playing = false; this.time = this.slider.value / 1000; this.wake(); };
      c.onpointerdown = e => { c.setPointerCapture(e.pointerId); fingers.set(e.pointerId, [e.clientX, e.clientY]); };
      c.onpointerup = c.onpointercancel = e => fingers.delete(e.pointerId);
      c.onpointermove = e => {
        const was = fingers.get(e.pointerId);
        if (!was) return;
        const now = [e.clientX, e.clientY];
        if (fingers.size === 2) {
          const still = [...fingers].find(([id]) => id !== e.pointerId)[1];
          this.zoom(Math.hypot(was[0] - still[0], was[1] - still[1]) / (Math.hypot(now[0] - still[0], now[1] - still[1]) || 1));
        } else {
          this.turn -= 0.01 * (now[0] - was[0]);
          this.tilt = Math.min(1.5, Math.max(-1.5, this.tilt + 0.01 * (now[1] - was[1])));
        }
        fingers.set(e.pointerId, now); this.wake();
      };
      c.addEventListener("wheel", e => {
        if (!e.ctrlKey) return; // the wheel alone scrolls the page
        e.preventDefault(); this.zoom(Math.exp(0.002 * e.deltaY));
      }, { passive: false });
      c.onkeydown = e => {
        const step = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] }[e.key];
        if (e.key === " ") this.button.onclick();
        else if (e.key === "+" || e.key === "-") this.zoom(e.key === "+" ? 0.9 : 1.1);
        else if (step) { this.turn += step[0]; this.tilt = Math.min(1.5, Math.max(-1.5, this.tilt + step[1])); }
        else return;
        e.preventDefault(); this.wake();
      };
    }

    // from as near as all corners of the box, and the field's arrow, are seen
    fit(aspect) {
      const { d } = this, c = Math.cos(this.tilt), half = [Math.max(1, aspect) / FOCAL, 1 / FOCAL / Math.min(1, aspect)];
      const back = [c * Math.cos(this.turn), c * Math.sin(this.turn), Math.sin(this.tilt)];
      const right = unit(cross([0, 0, 1], back)), up = cross(back, right);
      const s = this.walks ? 0.45 * d.size : 0, [low, high] = this.walks
        ? [this.target.map(v => v - s), this.target.map(v => v + s)] : d.box;
      let needed = 0;
      for (let k = 0; k < 8; k++) {
        const p = sub([0, 1, 2].map(i => (k >> i & 1 ? high : low)[i]), this.target);
        needed = Math.max(needed, Math.abs(dot(p, right)) / half[0] + dot(p, back), Math.abs(dot(p, up)) / half[1] + dot(p, back));
      }
      this.distance = 1.12 * needed; this.fitted = true;
    }

    zoom(factor) {
      this.distance = Math.min(20 * this.radius, Math.max(1.2 * this.radius, this.distance * factor)); this.wake();
    }

    wake() { if (!this.asked && this.visible) { this.asked = true; requestAnimationFrame(t => this.tick(t)); } }

    tick(now) {
      this.asked = false;
      const times = this.d.times, span = times[times.length - 1] - times[0];
      if (this.playing && span > 0 && this.last) {
        const shown = Math.min(12, Math.max(2, span)); // seconds of the whole
        this.time += (now - this.last) / 1000 / shown;
        if (this.time > 1 + 0.6 / shown) this.time = 0;
      }
      this.last = this.playing ? now : 0;
      this.button.textContent = this.playing ? "pause" : "play";
      this.draw(Math.min(1, this.time));
      if (this.playing) this.wake();
    }

    node(f, i) {
      const k = 3 * (f * this.d.nodes + i), { low, step } = this.d;
      return [low[0] + step * this.x[k], low[1] + step * this.x[k + 1], low[2] + step * this.x[k + 2]];
    }

    draw(share) {
      const { gl, d, canvas } = this, times = d.times;
      const when = times[0] + share * (times[times.length - 1] - times[0]);
      let f = times.findIndex(t => t >= when - 1e-9); if (f < 0) f = times.length - 1;
      const ratio = devicePixelRatio || 1;
      if (!this.fitted) this.fit(canvas.clientWidth / canvas.clientHeight);
      canvas.width = Math.round(canvas.clientWidth * ratio); canvas.height = Math.round(canvas.clientHeight * ratio);
      gl.viewport(0, 0, canvas.width, canvas.height);
      gl.clearColor(0.98, 0.98, 0.973, 1); gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT); gl.enable(gl.DEPTH_TEST);
      const nodes = Array.from({ length: d.nodes }, (_, i) => this.node(f, i));
      let target = this.target;
      if (this.walks) {
        target = [0, 1, 2].map(i => nodes.reduce((s, p) => s + p[i], 0) / nodes.length); target[2] = this.target[2];
      }
      const c = Math.cos(this.tilt);
      const eye = add(target, [c * Math.cos(this.turn), c * Math.sin(this.turn), Math.sin(this.tilt)], this.distance);
      const near = 0.02 * this.distance, far = 30 * this.distance;
      const view = matrix(eye, target, canvas.width / canvas.height, near, far);
      this.nearer = 2 * far * near / (near - far) * (1 / 0.996 - 1); // lines are drawn 0.4 % nearer than they are
      const mesh = [], paint = [], still = [], wash = [];
      d.triangles.forEach((n, k) => { mesh.push(...nodes[n]); paint.push(...d.colours[Math.floor(k / 3)]); });
      const arrows = (from, vector, radius, colour) => {
        const before = mesh.length; arrow(from, vector, radius, mesh);
        for (let k = before; k < mesh.length; k += 3) paint.push(...colour);
      };
      if (d.poling) d.poling[f].forEach(a => arrows(a.slice(0, 3), a.slice(3), 0.010 * d.size, [206, 44, 44]));
      if (d.field) {
        const v = d.field.vector[f].map(b => 0.5 * d.size * b);
        const at = this.walks ? add(add(target, sub(d.field.at, this.target), 0.9 * d.size / (Math.hypot(...sub(d.field.at, this.target)) || 1)), v, -0.5) : d.field.at;
        arrows(at, v, 0.014 * d.size, [24, 98, 214]);
      }
      const lines = [], colours = [];
      if (d.ground) this.ground(target, still, wash, lines);
      const thick = [];
      for (let k = 0; k < d.outlines.length; k += 2) lines.push([nodes[d.outlines[k]], nodes[d.outlines[k + 1]], INK]);
      for (let k = 0; k < d.creases.length; k += 2) {
        const at = 3 * (f * d.creases.length / 2 + k / 2);
        thick.push([nodes[d.creases[k]], nodes[d.creases[k + 1]], [...this.folds.slice(at, at + 3)]]);
      }
      const bands = [], glow = [];
      for (const [j, k, after, before, crease] of d.electrodes) {
        const mix = (a, b) => add(nodes[a], sub(nodes[b], nodes[a]), d.band), live = d.voltage ? d.voltage.live[f][crease] : 0;
        const q = [nodes[j], nodes[k], mix(k, after), mix(j, before)];
        for (const i of [0, 1, 2, 0, 2, 3]) {
          bands.push(...q[i]); glow.push(222 + 33 * live, 170 + 44 * live, 76 - 16 * live);
        }
      }
      this.triangles(still, wash, view, 1);
      this.triangles(mesh, paint, view, 0);
      gl.enable(gl.POLYGON_OFFSET_FILL); gl.polygonOffset(-1, -4);
      this.triangles(bands, glow, view, 0);
      gl.disable(gl.POLYGON_OFFSET_FILL);
      this.lines(lines, view, 0.5 * ratio); this.lines(thick, view, 1.3 * ratio);
      const said = [`${when.toFixed(2)} s`, d.field && d.field.said[f], d.voltage && d.voltage.said[f]];
      this.output.textContent = said.filter(Boolean).join("   ");
      if (document.activeElement !== this.slider) this.slider.value = Math.round(1000 * share);
    }

    ground(target, still, wash, lines) {
      const { up, height, step } = this.d.ground, reach = this.walks ? 2.2 * this.d.size : 1.5 * this.radius + this.d.size;
      const lift = p => [p[0], p[1], (height - p[0] * up[0] - p[1] * up[1]) / up[2]];
      const low = [0, 1].map(i => Math.floor((target[i] - reach) / step) * step);
      const count = Math.ceil(2 * reach / step), end = low.map(v => v + count * step);
      const at = (x, y) => add(lift([x, y]), up, -0.004 * this.d.size);
      const q = [at(low[0], low[1]), at(end[0], low[1]), at(end[0], end[1]), at(low[0], end[1])];
      for (const i of [0, 1, 2, 0, 2, 3]) { still.push(...q[i]); wash.push(228, 228, 223); }
      for (let k = 0; k <= count; k++) {
        const x = low[0] + k * step, y = low[1] + k * step;
        lines.push([at(x, low[1]), at(x, end[1]), [206, 206, 200]], [at(low[0], y), at(end[0], y), [206, 206, 200]]);
      }
    }

    feed(which, name, values, size) {
      const { gl } = this, place = gl.getAttribLocation(which, name);
      if (place < 0) return;
      const buffer = this.buffers[name + size] ??= gl.createBuffer();
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(values), gl.DYNAMIC_DRAW);
      gl.enableVertexAttribArray(place); gl.vertexAttribPointer(place, size, gl.FLOAT, false, 0, 0);
    }

    triangles(mesh, paint, view, flat) {
      if (!mesh.length) return;
      const { gl, surface } = this;
      gl.useProgram(surface);
      gl.uniformMatrix4fv(gl.getUniformLocation(surface, "view"), false, view);
      gl.uniform1f(gl.getUniformLocation(surface, "flat_"), flat);
      this.feed(surface, "at", mesh, 3); this.feed(surface, "colour", paint.map(v => v / 255), 3);
      gl.drawArrays(gl.TRIANGLES, 0, mesh.length / 3);
    }

    lines(lines, view, width) {
      if (!lines.length) return;
      const { gl, line, canvas } = this, at = [], other = [], side = [], colour = [];
      for (const [a, b, c] of lines) {
        // both ends look along the same way only with their sides swapped
        for (const [p, q, s] of [[a, b, 1], [a, b, -1], [b, a, -1], [b, a, -1], [a, b, -1], [b, a, 1]]) {
          at.push(...p); other.push(...q); side.push(s); colour.push(...c.map(v => v / 255));
        }
      }
      gl.useProgram(line);
      gl.uniformMatrix4fv(gl.getUniformLocation(line, "view"), false, view);
      gl.uniform2f(gl.getUniformLocation(line, "half_"), canvas.width / 2, canvas.height / 2);
      gl.uniform1f(gl.getUniformLocation(line, "width"), width);
      gl.uniform1f(gl.getUniformLocation(line, "nearer"), this.nearer);
      this.feed(line, "at", at, 3); this.feed(line, "other", other, 3);
      this.feed(line, "side", side, 1); this.feed(line, "colour", colour, 3);
      gl.drawArrays(gl.TRIANGLES, 0, at.length / 3);
    }
  }

  document.querySelectorAll("figure.viewer").forEach(f => new Viewer(f));
})();
