// The page: reads the episode, runs the clock, and connects the scene with slider, plots, events, groups and keys.

import { CAMERAS, Rig } from "./camera.js";
import { Episode, unpack } from "./data.js";
import { Plot, clock } from "./plots.js";
import { DESCRIPTORS, GROUPS, SIDES, View, degrees, knots, targetName } from "./view.js";
import { HULL_NAMES, OBSTACLE_NAMES } from "./shapes.js";

const $ = (id) => document.getElementById(id);
const SPEEDS = [0.25, 0.5, 1, 2, 5, 10, 20, 50];
const EVENTS = {
  cpa: ["Closest to", "#c01843"], collision: ["Collision with", "#d1001f"], grounding: ["Grounding", "#d1001f"], waypoint_reached: ["Waypoint", "#2461cf"], route_done: ["Route done", "#2461cf"],
  spawned: ["Appears", "#15803d"], removed: ["Removed", "#566770"], moved: ["Moved", "#566770"], waypoints_set: ["New route", "#566770"],
  ais_on: ["AIS on", "#0a6f6c"], ais_off: ["AIS off", "#0a6f6c"], radar_outage: ["Radar outage", "#b45309"], lidar_outage: ["LiDAR outage", "#b45309"],
  ais_jammed: ["AIS jammed", "#b45309"], gnss_frozen: ["GNSS frozen", "#b45309"],
};
const QUIET = new Set(["collision", "spawned", "removed", "moved", "waypoints_set", "ais_on", "ais_off", "route_done"]); // their text is who
const styleOf = (e) => EVENTS[e.kind] ?? [e.kind.replaceAll("_", " "), e.text === "begins" || e.text === "ends" ? "#b45309" : "#566770"];

class Page {
  constructor(live) {
    this.live = live;
    this.episode = new Episode();
    this.t = 0;
    this.speed = 1;
    this.playing = false;
    this.follow = !!live;
    this.dirty = true;
    this.rig = new Rig($("sea"), () => (this.dirty = true));
    this.view = new View($("sea"), $("labels"), this.rig);
  }

  /** A whole episode, or what is new in a live one. */
  take(...parts) {
    const first = !this.episode.header;
    for (const part of parts) this.episode.extend(part);
    this.view.load(this.episode);
    if (first) this.start();
    if (first && this.live) this.play(true);
    const { start, end } = this.episode;
    Object.assign($("time"), { min: start, max: end });
    this.listEvents();
    this.replot = this.dirty = true;
    if (this.follow && (first || end - this.t > 10 * this.speed)) this.seek(end, true);
  }

  start() {
    const { episode } = this, h = episode.header;
    this.t = episode.start;
    $("title").textContent = document.title = h.title || "episode";
    $("outcome").textContent = this.live ? "live" : h.outcome.replaceAll("_", " ");
    this.makeGroups();
    this.makePlots();
    this.makeControls();
    const wish = new URLSearchParams(location.hash.slice(1));
    if (wish.has("t")) this.seek(+wish.get("t"));
    if (wish.get("camera") in CAMERAS) this.useCamera(wish.get("camera"));
    for (const name of (wish.get("hide") ?? "").split(",")) if (name in GROUPS) this.show(name, false);
    for (const name of (wish.get("show") ?? "").split(",")) if (name in GROUPS) this.show(name, true);
    this.resize();
    new ResizeObserver(() => this.resize()).observe($("stage"));
    let last = performance.now();
    const frame = (now) => {
      requestAnimationFrame(frame);
      const dt = Math.min(0.1, (now - last) / 1000);
      last = now;
      if (this.playing) this.advance(dt);
      if (this.playing || this.dirty) this.draw(this.playing ? dt * Math.min(2, Math.max(0.5, this.speed)) : 0);
    };
    requestAnimationFrame(frame);
  }

  // --- time ------------------------------------------------------------------------------------------------------------
  advance(dt) {
    const t = this.t + dt * this.speed;
    // a live picture follows one part behind, a little faster when it fell back
    const behind = this.follow ? this.episode.end - this.t : 0;
    this.seek(behind > 2 * this.speed ? t + 0.2 * dt * this.speed : t, true);
    if (t >= this.episode.end && !this.live) this.play(false);
  }

  seek(t, keep = false) {
    const { start, end } = this.episode;
    this.t = Math.min(end, Math.max(start, t));
    if (!keep) this.follow = this.live && this.t >= end - 1e-6;
    this.dirty = true;
  }

  play(on = !this.playing) {
    if (on && this.t >= this.episode.end && !this.live) this.seek(this.episode.start);
    this.playing = on;
    document.body.classList.toggle("playing", on);
    $("play").setAttribute("aria-label", on ? "pause" : "play");
    this.dirty = true;
  }

  setSpeed(k) {
    this.speed = SPEEDS[Math.min(SPEEDS.length - 1, Math.max(0, k))];
    $("speed").value = this.speed;
  }

  jump(step) {
    const times = this.episode.header.events.map((e) => e.t), near = 0.05;
    const next = step > 0 ? times.find((t) => t > this.t + near) : times.findLast((t) => t < this.t - near);
    if (next !== undefined) this.seek(next);
  }

  // --- picture ---------------------------------------------------------------------------------------------------------
  resize() {
    const { clientWidth: w, clientHeight: h } = $("stage");
    if (!w || !h) return;
    this.view.resize(w, h, Math.min(2, window.devicePixelRatio || 1));
    this.replot = this.dirty = true;
  }

  draw(dt) {
    this.dirty = false;
    const { episode, view, t } = this, [i] = episode.index(t), stage = $("stage").getBoundingClientRect();
    const own = view.update(t, dt);
    this.showCard(i);
    const taken = [...document.querySelectorAll("[data-keep]")].filter((e) => e.checkVisibility()).map((e) => {
      const r = e.getBoundingClientRect();
      return [r.left - stage.left - 4, r.top - stage.top - 4, r.right - stage.left + 4, r.bottom - stage.top + 4];
    });
    view.draw(stage.width, stage.height, taken);
    if (this.replot) for (const plot of this.plots) plot.prepare(episode.t);
    this.replot = false;
    for (const plot of this.plots) plot.draw(t, i);
    $("time").value = t;
    $("time").style.setProperty("--done", `${(100 * (t - episode.start)) / (episode.end - episode.start || 1)}%`);
    $("clock").textContent = `${clock(Math.floor(t + 1e-6))}.${Math.floor((t % 1) * 10 + 1e-6)}`;
    $("length").textContent = clock(episode.end);
    this.showGauges(own, i);
    $("needle").style.transform = `rotate(${-this.rig.yaw}rad)`;
    const now = episode.header.events.findLastIndex((e) => e.t <= t + 0.05);
    if (now === this.now) return;
    this.now = now;
    [...$("events").children].forEach((b, k) => b.classList.toggle("now", k === now));
    const row = $("events").children[now] ?? { offsetTop: 0, offsetHeight: 1 };
    const above = Math.floor(($("events").clientHeight - row.offsetHeight) / 2 / row.offsetHeight);  // whole rows
    $("events").scrollTop = row.offsetTop - above * row.offsetHeight - 4;
  }

  showGauges(own, i) {
    const { episode } = this, { distance } = episode.closest(i);
    const others = Array.from({ length: episode.S }, (_, s) => s).filter((s) => s !== episode.own && episode.series.active.rows[s][i]).length;
    const wind = episode.at("wind", 0, this.t), to = episode.at("wind_to", 0, this.t), wave = episode.at("wave_height", 0, this.t);
    const values = {
      heading: degrees(own.psi), sog: `${knots(own.sog)} kn`, rot: `${own.rot < 0 ? "−" : "+"}${Math.abs((own.rot * 180 * 60) / Math.PI).toFixed(0)}°/min`,
      near: Number.isFinite(distance) ? `${distance.toFixed(0)} m` : "–", tracks: `${this.view.targets.length} / ${others}`,
      wind: wind > 0.05 ? `${wind.toFixed(1)} m/s ${degrees(to + Math.PI)}` : "calm", waves: `${wave.toFixed(1)} m`,
    };
    for (const [name, value] of Object.entries(values)) $(`g-${name}`).textContent = value;
  }

  // --- panel -----------------------------------------------------------------------------------------------------------
  makeGroups() {
    for (const [name, [caption, on]] of Object.entries(GROUPS)) {
      const label = $("groups").appendChild(document.createElement("label"));
      const box = label.appendChild(Object.assign(document.createElement("input"), { type: "checkbox", checked: on, id: `show-${name}` }));
      label.append(caption);
      label.hidden = name === "land" && !this.episode.header.land?.length;
      box.addEventListener("change", () => this.show(name, box.checked));
    }
  }

  show(name, on) {
    this.view.visible[name] = on;
    $(`show-${name}`).checked = on;
    this.dirty = true;
  }

  makePlots() {
    const { episode } = this, h = episode.header, own = episode.own, seek = (t) => this.seek(t);
    const row = (name, r = own) => (i) => episode.series[name].rows[r][i];
    const near = [];
    const nearest = (i) => (i < episode.t.length - 1 ? (near[i] ??= episode.closest(i).distance) : episode.closest(i).distance);
    const share = (side) => {
      const which = h.thrusters.map(([, , s], k) => (s === side ? k : -1)).filter((k) => k >= 0);
      const [x, y] = [episode.series.thrust_x, episode.series.thrust_y];
      return which.length && ((i) => (100 * which.reduce((sum, k) => sum + Math.sign(side === "bow" ? y.rows[k][i] : x.rows[k][i]) * Math.hypot(x.rows[k][i], y.rows[k][i]), 0)) / which.length);
    };
    const thrust = Object.entries(SIDES).map(([side, colour]) => ({ colour, name: side === "starboard" ? "stbd" : side, value: share(side), text: (v) => `${v.toFixed(0)} %` })).filter((c) => c.value);
    this.plots = [
      new Plot($("plots"), "Speed", [{ colour: "#2461cf", name: "SOG", value: (i) => row("sog")(i) / 0.514444, text: (v) => `${v.toFixed(1)} kn` }], { zero: true, span: 1, seek }),
      new Plot($("plots"), "Heading", [{ colour: "#a42bb0", name: "HDG", value: (i) => (row("psi")(i) * 180) / Math.PI, text: (v) => degrees((v * Math.PI) / 180) }],
        { span: 10, tick: (v) => `${Math.round(((v % 360) + 360) % 360)}°`, seek }),
      new Plot($("plots"), "Range to closest", [{ colour: "#c01843", name: "", value: nearest, text: (v) => `${v.toFixed(0)} m` }], { zero: true, span: 20, seek }),
    ];
    if (thrust.length) this.plots.push(new Plot($("plots"), "Thrust", thrust, { zero: true, span: 20, tick: (v) => `${Math.round(v)}`, seek }));
  }

  listEvents() {
    const { header: h, start, end } = this.episode, list = h.events;
    if (list.length === this.listed && !this.live) return;
    [this.listed, this.now] = [list.length, null];
    $("events").replaceChildren(...list.map((e) => {
      const [caption, colour] = styleOf(e);
      const button = document.createElement("button");
      const dot = Object.assign(document.createElement("i"), { style: `background:${colour}` });
      const who = e.id >= 0 ? h.names[e.id] : "", detail = QUIET.has(e.kind) ? "" : e.text;
      const what = e.kind === "waypoint_reached" ? `${who}: waypoint ${detail}` : e.kind === "cpa" ? `${detail} to ${who}` : `${caption} ${who} ${detail}`;
      const time = Object.assign(document.createElement("time"), { textContent: clock(e.t) });
      button.append(time, dot, Object.assign(document.createElement("span"), { textContent: what.trim() }));
      button.addEventListener("click", () => {
        this.play(false);
        this.seek(e.t);
        if (e.id >= 0 && e.id !== this.episode.own) this.select(e.id);
      });
      return button;
    }));
    $("marks").replaceChildren(...list.map((e) => {
      const mark = document.createElement("i");
      mark.style.left = `${(100 * (e.t - start)) / (end - start || 1)}%`;
      mark.style.background = styleOf(e)[1];
      return mark;
    }));
  }

  makeControls() {
    $("play").addEventListener("click", () => this.play());
    $("back").addEventListener("click", () => this.jump(-1));
    $("forth").addEventListener("click", () => this.jump(1));
    $("time").addEventListener("input", () => this.seek(+$("time").value));
    $("speed").replaceChildren(...SPEEDS.map((x) => new Option(`${x}×`, x)));
    this.setSpeed(2);
    if (this.live) this.setSpeed(SPEEDS.indexOf(this.pace) >= 0 ? SPEEDS.indexOf(this.pace) : 2);
    $("speed").addEventListener("change", () => this.setSpeed(SPEEDS.indexOf(+$("speed").value)));
    for (const [name, caption] of Object.entries(CAMERAS)) {
      const button = $("cameras").appendChild(Object.assign(document.createElement("button"), { textContent: caption, id: `camera-${name}` }));
      button.addEventListener("click", () => this.useCamera(name));
    }
    this.useCamera("chase");
    $("fold").addEventListener("click", () => document.body.classList.toggle("folded"));
    $("help").addEventListener("click", () => this.help());
    $("keys").addEventListener("click", () => this.help());
    $("card-close").addEventListener("click", () => this.select(-1));
    let at = null;
    $("sea").addEventListener("pointerdown", (e) => (at = [e.clientX, e.clientY]));
    $("sea").addEventListener("pointerup", (e) => {
      if (!at || e.button || Math.hypot(e.clientX - at[0], e.clientY - at[1]) > 5) return;
      const r = $("sea").getBoundingClientRect(), [x, y] = [e.clientX - r.left, e.clientY - r.top];
      if (this.live && document.body.classList.contains("spawning")) this.spawn((2 * x) / r.width - 1, 1 - (2 * y) / r.height);
      else this.select(this.view.pick(x, y));
    });
    addEventListener("keydown", (e) => this.key(e));
    if (this.live) $("spawn").addEventListener("click", () => document.body.classList.toggle("spawning"));
  }

  useCamera(name) {
    this.rig.use(name);
    for (const button of $("cameras").children) button.setAttribute("aria-pressed", button.id === `camera-${name}`);
  }

  select(source) {
    this.view.selected = source;
    this.dirty = true;
  }

  help() { document.body.classList.toggle("helping"); }

  key(e) {
    if (e.target.matches("select, input[type=text]") || e.ctrlKey || e.metaKey || e.altKey) return;
    const k = SPEEDS.indexOf(this.speed), cameras = Object.keys(CAMERAS);
    const actions = {
      " ": () => this.play(), ArrowLeft: () => this.seek(this.t - (e.shiftKey ? 10 : 1)), ArrowRight: () => this.seek(this.t + (e.shiftKey ? 10 : 1)),
      ArrowUp: () => this.setSpeed(k + 1), ArrowDown: () => this.setSpeed(k - 1), Home: () => this.seek(this.episode.start), End: () => this.seek(this.episode.end),
      n: () => this.jump(1), p: () => this.jump(-1), l: () => this.show("labels", !this.view.visible.labels), d: () => this.show("detections", !this.view.visible.detections),
      s: () => this.show("shadows", !this.view.visible.shadows), r: () => this.show("rings", !this.view.visible.rings), f: () => $("fold").click(),
      "?": () => this.help(), Escape: () => (document.body.classList.remove("helping", "spawning"), this.select(-1)),
    };
    const action = actions[e.key] ?? (cameras[+e.key - 1] && (() => this.useCamera(cameras[+e.key - 1])));
    if (!action) return;
    e.preventDefault();
    action();
  }

  /** What is known about the selected object: truth, and what the sensors say. */
  showCard(i) {
    const { episode, view, t } = this, h = episode.header, s = view.selected;
    $("card").hidden = s < 0;
    if (s < 0) return;
    const [, f] = episode.index(t), q = episode.state(s, i, f), vessel = episode.isVessel(s), own = episode.state(episode.own, i, f);
    const kind = (vessel ? HULL_NAMES : OBSTACLE_NAMES)[h.kinds[s]] ?? "object";
    const size = vessel ? `${h.length[s].toFixed(0)} × ${h.beam[s].toFixed(1)} m` : `radius ${h.radius[s - episode.V].toFixed(1)} m`;
    const lat = h.origin[0] + q.north / h.metres_per_degree[0], lon = h.origin[1] + q.east / h.metres_per_degree[1];
    const rows = [["", "Truth"], ["size", size], ["position", `${lat.toFixed(5)}°, ${lon.toFixed(5)}°`]];
    if (h.mmsi[s] && h.ais_class[s]) rows.push(["MMSI", h.mmsi[s]]);
    if (vessel) rows.push(["heading, speed", `${degrees(q.psi)}  ${knots(q.sog)} kn`]);
    if (s !== episode.own) {
      rows.push(["bearing, range", `${degrees(Math.atan2(q.east - own.east, q.north - own.north))}  ${Number.isFinite(q.distance) ? q.distance.toFixed(0) : "–"} m`]);
      rows.push(["line of sight", ["none", "radar", "LiDAR", "radar, LiDAR"][q.seen]]);
      const d = view.targets.find((x) => x.source === s);
      rows.push(["", d ? `Detected as ${targetName(d)}` : "Not detected"]);
      if (d) {
        rows.push(["descriptor", DESCRIPTORS[d.descriptor]], ["sensors", ["AIS", "radar", "LiDAR"].filter((_, k) => (d.sensors >> k) & 1).join(", ")]);
        if (Number.isFinite(d.cog) && d.motion_known) rows.push(["COG, SOG", `${degrees(d.cog)}  ${knots(d.sog)} kn`]);
        if (Number.isFinite(d.radius)) rows.push(["apparent radius", `${d.radius.toFixed(1)} m`]);
        rows.push(["position error", `${Math.hypot(d.north - q.north, d.east - q.east).toFixed(1)} m`]);
      }
      const r = episode.report(s, t);
      if (r) rows.push(["last AIS", `${(t - r.t).toFixed(0)} s ago`]);
    }
    $("card-title").textContent = s === episode.own ? "Own ship" : h.names[s];
    $("card-kind").textContent = q.active ? kind : `${kind}, not there`;
    $("card-rows").replaceChildren(...rows.map(([name, value]) => {
      const row = document.createElement("tr");
      if (!name) row.append(Object.assign(document.createElement("th"), { textContent: value, colSpan: 2 }));
      else row.append(Object.assign(document.createElement("td"), { textContent: name }), Object.assign(document.createElement("td"), { textContent: value }));
      return row;
    }));
  }

  // --- live ------------------------------------------------------------------------------------------------------------
  async spawn(x, y) {
    const place = this.rig.water(x, y);
    document.body.classList.remove("spawning");
    if (!place) return;
    const answer = await fetch("spawn", { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify({ north: place[0], east: place[1] }) });
    this.say(answer.ok ? "" : await answer.text());
    setTimeout(() => this.say(""), 6000);
  }

  /** The live episode is over: from now on it is a replay. */
  finish(outcome) {
    $("outcome").textContent = outcome.replaceAll("_", " ");
    document.body.classList.remove("live", "spawning");
    this.live = this.follow = false;
  }

  say(message) {
    $("message").textContent = message;
    $("message").hidden = !message;
  }
}

async function run() {
  const live = document.body.dataset.live;
  const page = (window.replay = new Page(live));
  if (!live) {
    const part = await unpack($("episode").textContent.trim()).catch((error) => {
      throw new Error("its data are damaged", { cause: error });
    });
    return page.take(part);
  }
  document.body.classList.add("live");
  const waiting = [];
  let idle = true, over = null;
  // all that came since the last time at once: a slow computer must not fall behind
  const read = async () => {
    if (!idle) return;
    idle = false;
    while (waiting.length) page.take(...(await Promise.all(waiting.splice(0).map(unpack))));
    if (over !== null) page.finish(over);
    idle = true;
  };
  const source = new EventSource(live);
  source.addEventListener("part", (e) => {
    waiting.push(e.data);
    read();
  });
  source.addEventListener("pace", (e) => (page.pace = +e.data));
  source.addEventListener("end", (e) => {
    source.close();
    over = e.data;
    read();
  });
}

run().catch((error) => {
  $("message").hidden = false;
  $("message").textContent = `The replay cannot be shown: ${error.message}`;
  console.error(error);
});
