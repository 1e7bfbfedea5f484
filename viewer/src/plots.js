// Curves over time with a cursor; a click or a drag seeks.

const INK = "#33464f", MUTED = "#71848d", GRID = "#dbe6ea";

export class Plot {
  /** `curves`: [{ colour, name, value(i), text(v) }]; `options`: tick(v), zero, least span. */
  constructor(parent, title, curves, { tick = String, zero = false, span = 1, seek }) {
    Object.assign(this, { curves, tick, zero, span });
    this.element = parent.appendChild(document.createElement("section"));
    this.element.className = "plot";
    const head = this.element.appendChild(document.createElement("h3"));
    head.append(title);
    for (const curve of curves) {
      curve.output = head.appendChild(document.createElement("output"));
      curve.output.style.color = curve.colour;
    }
    this.canvas = this.element.appendChild(document.createElement("canvas"));
    this.sheet = document.createElement("canvas");
    const jump = (e) => {
      if (e.type === "pointerdown") this.canvas.setPointerCapture(e.pointerId);
      else if (!e.buttons) return;
      const { left } = this.canvas.getBoundingClientRect();
      seek(this.start + ((e.clientX - left - this.left) / (this.width - this.left - 6)) * (this.end - this.start));
    };
    this.canvas.addEventListener("pointerdown", jump);
    this.canvas.addEventListener("pointermove", jump);
  }

  /** Draw grid and curves on a sheet of their own. */
  prepare(times) {
    const ratio = window.devicePixelRatio || 1, { clientWidth: w, clientHeight: h } = this.canvas;
    if (!w || !h) return;
    Object.assign(this, { width: w, height: h, ratio, left: 34, start: times[0], end: Math.max(times.at(-1), times[0] + 1) });
    for (const c of [this.sheet, this.canvas]) [c.width, c.height] = [Math.round(w * ratio), Math.round(h * ratio)];
    const g = this.sheet.getContext("2d");
    g.scale(ratio, ratio);
    g.font = "10.5px system-ui, sans-serif";
    const series = this.curves.map((c) => times.map((_, i) => c.value(i)));
    const finite = series.flat().filter(Number.isFinite);
    let low = Math.min(...bounds(finite), this.zero ? 0 : Infinity), high = Math.max(...bounds(finite), this.zero ? 0 : -Infinity);
    if (!finite.length) [low, high] = [0, 1];
    if (high - low < this.span) [low, high] = this.zero && low >= 0 ? [low, low + this.span] : [(low + high - this.span) / 2, (low + high + this.span) / 2];
    const room = 0.07 * (high - low);
    [low, high] = [low - (this.zero && low === 0 ? 0 : room), high + room];
    const bottom = h - 15, x = (t) => this.left + ((t - this.start) / (this.end - this.start)) * (w - this.left - 6);
    const y = (v) => bottom - ((v - low) / (high - low)) * (bottom - 4);
    g.strokeStyle = GRID;
    g.fillStyle = MUTED;
    g.lineWidth = 1;
    const step = nice(high - low, 3);
    g.textAlign = "right";
    g.textBaseline = "middle";
    for (let v = Math.ceil(low / step) * step; v <= high; v += step) {
      line(g, this.left, y(v), w - 6, y(v));
      g.fillText(this.tick(Math.abs(v) < 1e-9 ? 0 : v), this.left - 5, Math.max(6, y(v)));
    }
    const tick = niceTime((this.end - this.start) / 4);
    g.textAlign = "center";
    g.textBaseline = "alphabetic";
    for (let t = Math.ceil(this.start / tick) * tick; t <= this.end; t += tick) {
      line(g, x(t), 4, x(t), bottom);
      g.fillText(clock(t), Math.min(w - 18, Math.max(this.left + 8, x(t))), h - 3);
    }
    series.forEach((values, k) => {
      const { colour } = this.curves[k], path = new Path2D(), area = new Path2D();
      let from = null;
      const every = Math.max(1, Math.floor(values.length / (4 * w)));
      for (let i = 0; i < values.length; i += every) {
        if (!Number.isFinite(values[i])) { from = null; continue; }
        const [px, py] = [x(times[i]), y(values[i])];
        if (from === null) path.moveTo(px, py), area.moveTo(px, y(Math.max(low, Math.min(high, 0))));
        else path.lineTo(px, py);
        area.lineTo(px, py);
        from = px;
        if (i + every >= values.length || !Number.isFinite(values[i + every])) area.lineTo(px, y(Math.max(low, Math.min(high, 0))));
      }
      if (this.zero && this.curves.length === 1) {
        g.globalAlpha = 0.11;
        g.fillStyle = colour;
        g.fill(area);
      }
      g.globalAlpha = 1;
      g.strokeStyle = colour;
      g.lineWidth = k === 0 && this.curves.length > 1 ? 3.4 : 1.7; // so that the first shows under one just like it
      g.lineJoin = "round";
      g.stroke(path);
    });
    this.map = { x, y };
  }

  draw(t, i) {
    if (!this.map) return;
    const g = this.canvas.getContext("2d"), { x, y } = this.map;
    g.setTransform(1, 0, 0, 1, 0, 0);
    g.clearRect(0, 0, this.canvas.width, this.canvas.height);
    g.drawImage(this.sheet, 0, 0);
    g.scale(this.ratio, this.ratio);
    g.strokeStyle = INK;
    g.lineWidth = 1.2;
    line(g, x(t), 2, x(t), this.height - 14);
    for (const curve of this.curves) {
      const v = curve.value(i);
      curve.output.textContent = `${curve.name} ${Number.isFinite(v) ? curve.text(v) : "–"}`;
      if (!Number.isFinite(v)) continue;
      g.fillStyle = curve.colour;
      g.strokeStyle = "#fff";
      g.beginPath();
      g.arc(x(t), y(v), 3.4, 0, 7);
      g.fill();
      g.stroke();
    }
  }
}

export const clock = (t) => {
  const s = Math.round(t);
  return `${Math.floor(s / 60)}:${String(Math.abs(s) % 60).padStart(2, "0")}`;
};

function bounds(values) {
  let low = Infinity, high = -Infinity;
  for (const v of values) [low, high] = [Math.min(low, v), Math.max(high, v)];
  return [low, high];
}

function nice(span, parts) {
  const raw = span / parts, power = 10 ** Math.floor(Math.log10(raw));
  return [1, 2, 5, 10].map((f) => f * power).find((v) => v >= raw * 0.999);
}

const niceTime = (raw) => [1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1200, 1800, 3600].find((v) => v >= raw) ?? 7200;

function line(g, x0, y0, x1, y1) {
  g.beginPath();
  g.moveTo(x0, y0);
  g.lineTo(x1, y1);
  g.stroke();
}
