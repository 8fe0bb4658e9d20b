"use strict";
/* The page of the live service: a table of all sessions; one session over time and against velocity. */

const KEEP_S = 60, SPARK = 300, SLOPE_S = 0.1, BIN_M_S = 0.01, BIN_ROWS = 400, FEWEST = 20, DAY_S = 86400, STALE_S = 3;
const COLOURS = ["#888888", "#e69f00", "#cc79a7", "#d55e00", "#d55e00", "#d55e00", "#999933", "#e69f00", "#d55e00", "#bbbbbb"];
const colourOf = (bit) => COLOURS[bit] ?? "#882255";
const by = (id) => document.getElementById(id);
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const inView = new Set(), watcher = new IntersectionObserver((entries) => entries.forEach((each) => each.isIntersecting ? inView.add(each.target) : inView.delete(each.target)));
const collator = new Intl.Collator("en", { numeric: true });
const sparks = new Map(), rows = new Map(), steady = new Map();
const SORTS = { name: (each) => each.name, friction: (each) => -(each.newtons?.[0] ?? -Infinity), flags: (each) => -each.flags.length, samples: (each) => -each.index, lag: (each) => -(each.lag_s ?? 0) };
let socket = null, shown = null, frozen = false, plots = null, stribeck = {}, flagNames = [], sampleTimeS = 0.005, columns = [0, 1, 2], corrections = [], sort = "name", ordered = "", steadyIndex = -1, cutAt = null;
const INPUTS = ["pressure_1_pa", "pressure_2_pa", "position_m"];
const data = { index: [], newtons: [[], [], []], samples: [[], [], []], flags: [] };

function connect() {
  const token = sessionStorage.getItem("token"), address = `${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/watch`;
  socket = token ? new WebSocket(address, ["cylinder-friction", "token." + base64url(token)]) : new WebSocket(address);
  socket.onopen = () => socket.send(shown ?? "");
  socket.onclose = (event) => {
    if (event.code === 4401 || event.code === 4403) { login(event.reason); return; }
    cut();
    setTimeout(connect, 1000);
  };
  socket.onmessage = (event) => {
    const content = JSON.parse(event.data);
    if (content.sessions) {
      sampleTimeS = content.sample_time_s;
      by("bounds").title = content.bounds;
      cutAt = null;
      document.body.classList.remove("cut");
      columns = INPUTS.map((name) => content.inputs.indexOf(name));
      corrections = INPUTS.map((name) => content.corrections[name] ?? { sign: 1, offset: 0 });
      table(content.sessions);
    } else if (content.rows) { if (content.begins) clear(); take(content.rows); text(by("model"), `by ${content.model}`); }
    else if (content.stribeck) { stribeck = content.stribeck; explain(content.flags); }
  };
}

function base64url(text) {
  const bytes = Array.from(new TextEncoder().encode(text), (byte) => String.fromCharCode(byte)).join("");
  return btoa(bytes).replaceAll("+", "-").replaceAll("/", "_").replaceAll("=", "");
}

/* Without a connection nothing that is shown is of now. */
function cut() {
  cutAt ??= new Date();
  document.body.classList.add("cut");
  text(by("state"), `no connection to the service since ${clockTime(cutAt)}; trying again…`);
  for (const row of rows.values()) text(row.children[5], "–");
  if (shown !== null) text(by("silence"), `No connection to the service since ${clockTime(cutAt)}.`);
}

function clockTime(date) { return date.toLocaleTimeString("en-GB"); }

function explain(flags) {
  flagNames = flags.map((each) => each.name);
  by("flag-words").replaceChildren(...flags.flatMap((each) => [["dt", spoken(each.name)], ["dd", `${each.meaning}. To do: ${each.advice}.`]].map(([kind, words]) => {
    const element = document.createElement(kind);
    element.textContent = words;
    return element;
  })));
}

function spoken(flag) { return flag.toLowerCase().replaceAll("_", " "); }

/* What is to be stated of a session beside its flags: since when nothing comes, and whether anybody sends. */
function silence(each) {
  if (each.rest_s <= STALE_S && !each.ended) return "";
  const since = clockTime(new Date(Date.now() - 1e3 * each.rest_s));
  return `${each.ended ? "ended; " : ""}${each.newtons === null ? "no samples yet" : `no samples since ${since}`}`;
}

function login(reason) {
  const tried = sessionStorage.getItem("token") !== null;
  sessionStorage.removeItem("token");
  by("state").textContent = tried ? reason : "This service asks for a token.";
  by("login").hidden = false;
  by("token").focus();
}

function table(sessions) {
  by("none").hidden = sessions.length > 0;
  by("sessions").hidden = sessions.length === 0;
  const seen = new Set(), wanted = by("filter").value.trim().toLowerCase(), mark = css("--mark");
  for (const each of sessions) {
    seen.add(each.name);
    const row = rows.get(each.name) ?? addRow(each.name);
    const [friction, lower, upper] = each.newtons ?? [null, null, null], cells = row.children, spark = sparks.get(each.name), silent = silence(each);
    const flags = [silent, each.flags.map(spoken).join(", "), each.too_narrow].filter(Boolean).join("; ");
    const good = each.flags.every((flag) => flag === "OFFSET_UNKNOWN");
    spark.push(good && silent === "" ? friction : null);
    if (spark.length > SPARK) spark.shift();
    if (each.name === shown) { counts(each.counts); text(by("silence"), sentenceOf(silent)); }
    row.classList.toggle("stale", silent !== "");
    row.hidden = !`${each.name} ${flags}`.toLowerCase().includes(wanted);
    if (!inView.has(row)) continue;
    cells[1].className = good ? "" : "unusable";
    cells[2].className = good ? "wide" : "wide unusable";
    text(cells[1], friction === null ? "–" : friction.toFixed(0));
    text(cells[2], friction === null ? "–" : `${lower.toFixed(0)} to ${upper.toFixed(0)}`);
    text(cells[3], each.not_known ? [silent, `not to be used: ${each.not_known}`].filter(Boolean).join("; ") : flags);
    text(cells[4], each.index.toLocaleString("en"));
    text(cells[5], silent ? "–" : lag(each.lag_s));
    draw(cells[6].firstChild, spark, mark);
  }
  for (const [name, row] of rows) if (!seen.has(name)) { watcher.unobserve(row); inView.delete(row); row.remove(); rows.delete(name); sparks.delete(name); }
  const visible = [...rows.values()].filter((row) => !row.hidden).length;
  const ended = sessions.filter((each) => each.ended).length, done = ended === 0 ? "" : ended === sessions.length ? ", all ended" : `, ${ended} ended`;
  text(by("state"), `${sessions.length} session${sessions.length === 1 ? "" : "s"}${visible < sessions.length ? `, ${visible} shown` : ""}${done}`);
  if (shown !== null && !seen.has(shown)) text(by("silence"), "This session is not open now: nobody has sent samples since the service was started, or for long.");
  order(sessions);
}

function order(sessions) {
  const key = SORTS[sort], names = sessions.map((each) => ({ name: each.name, by: key(each) }));
  names.sort((a, b) => typeof a.by === "string" ? collator.compare(a.by, b.by) : a.by - b.by || collator.compare(a.name, b.name));
  const now = names.map((each) => each.name).join("\n"), focused = document.activeElement;
  if (now === ordered || by("sessions").matches(":hover") && sort !== "name" && ordered.length === now.length) return;
  ordered = now;
  by("sessions").tBodies[0].append(...names.map((each) => rows.get(each.name)));
  if (focused?.tagName === "TR") focused.focus();
}

function lag(seconds) {
  if (seconds === null || Math.abs(seconds) > DAY_S) return "–";
  if (seconds < -1) return `ahead ${-seconds.toFixed(0)} s`;
  return Math.abs(seconds) < 10 ? `${(1e3 * seconds).toFixed(0)} ms` : `${seconds.toFixed(0)} s`;
}

function text(cell, value) { if (cell.textContent !== value) cell.textContent = value; }

function addRow(name) {
  const row = document.createElement("tr");
  row.tabIndex = 0;
  row.innerHTML = '<td></td><td></td><td class="wide"></td><td class="flags"></td><td class="wide"></td><td class="wide"></td><td><canvas width="240" height="44"></canvas></td>';
  row.firstChild.append(...name.split(/(?<=[_.:/-])/).flatMap((part) => [part, document.createElement("wbr")]));
  row.onclick = () => show(name);
  by("sessions").tBodies[0].append(row);
  rows.set(name, row);
  watcher.observe(row);
  sparks.set(name, []);
  return row;
}

function draw(canvas, values, mark) {
  const pen = canvas.getContext("2d"), known = values.filter((value) => value !== null), low = Math.min(...known), high = Math.max(...known, low + 1);
  pen.clearRect(0, 0, canvas.width, canvas.height);
  pen.strokeStyle = mark;
  pen.lineWidth = 2;
  pen.beginPath();
  values.forEach((value, at) => {
    if (value === null) return;
    const place = [at / SPARK * canvas.width, 2 + (high - value) / (high - low) * (canvas.height - 4)];
    if (values[at - 1] == null) pen.moveTo(...place); else pen.lineTo(...place);
  });
  pen.stroke();
}

function counts(content) {
  const parts = Object.entries(content).filter(([name, count]) => count && name !== "stepped");
  by("counts").textContent = parts.map(([name, count]) => `${name}: ${count.toLocaleString("en")}`).join(", ");
}

function show(name) {
  shown = name;
  clear();
  text(by("silence"), "");
  by("detail").hidden = false;
  document.body.classList.add("showing");
  by("detail-title").textContent = name;
  freeze(false);
  makePlots();
  socket.send(name);
  by("detail").scrollIntoView({ behavior: "smooth" });
}

function clear() {
  for (const column of [data.index, data.flags, ...data.newtons, ...data.samples]) column.length = 0;
  steady.clear();
  steadyIndex = -1;
}

function sentenceOf(silent) {
  const sentence = silent && `${silent[0].toUpperCase()}${silent.slice(1)}.`;
  if (data.index.length) return sentence && `${sentence} Below: its last rows.`;
  return `${sentence || "Waiting for samples."}${sentence ? " Its rows, if there are any, are in the service's history folder." : ""}`;
}

/* The identified curves that apply to the shown session: one for all, or those whose condition its name states. */
function applying() { return Object.keys(stribeck).filter((name) => stribeck[name].everywhere || states(shown ?? "", name)); }

function states(session, condition) {
  const escaped = condition.replaceAll(/[.*+?^${}()|[\]\\]/g, "\\$&"), word = /^\d+$/.test(condition) ? `condition[ _-]?${escaped}` : escaped;
  return new RegExp(`(^|[^a-z0-9])${word}([^a-z0-9]|$)`, "i").test(session);
}

function curveWords() {
  const names = Object.keys(stribeck), drawn = applying();
  if (!names.length) return "";
  if (drawn.length) return `Dashed: the Stribeck curve identified before, of condition ${drawn.join(", ")}. If friction moves away from it, the seal, the oil temperature or the pressure has changed.`;
  return `No identified Stribeck curve is drawn: those given are of condition ${names.join(", ")}, which this session's name does not state.`;
}

function hide() { shown = null; by("detail").hidden = true; document.body.classList.remove("showing"); socket.send(""); }

function take(part) {
  if (shown === null) return;
  if (data.index.length && part.index.length && part.index[0] !== data.index.at(-1) + 1) {  // a row of nothing breaks the lines
    for (const column of [data.flags, ...data.newtons, ...data.samples]) column.push(null);
    data.index.push(data.index.at(-1) + 1);
  }
  data.index.push(...part.index);
  data.flags.push(...part.flags);
  for (const row of part.newtons) row.forEach((value, at) => data.newtons[at].push(value));
  for (const row of part.samples) columns.forEach((column, at) => data.samples[at].push(corrected(row[column] ?? null, corrections[at])));
  const extra = data.index.length - KEEP_S / sampleTimeS;
  if (extra > 0) for (const column of [data.index, data.flags, ...data.newtons, ...data.samples]) column.splice(0, extra);
  gather();
  if (!frozen) redraw();
}

/* A reading of a sensor as the model's mapping has it: otherwise friction would stand at velocities of the other sign. */
function corrected(reading, { sign, offset }) { return reading === null ? null : sign * (reading - offset); }

/* Newtons at steady velocity, by velocity, since the session is shown: the newest of each bin. */
function gather() {
  const half = Math.round(SLOPE_S / sampleTimeS / 2), x = data.samples[2], begin = data.index.findIndex((index) => index > steadyIndex);
  if (begin < 0) return;
  for (let at = Math.max(begin, 2 * half); at + 2 * half < x.length; at++) {
    steadyIndex = data.index[at];
    const [a, b, c, d] = [-2, -1, 1, 2].map((step) => x[at + step * half]);
    if (a == null || b == null || c == null || d == null || !whole(at, 2 * half) || !usable(data.flags[at])) continue;
    const speed = (c - b) / (2 * half * sampleTimeS), change = Math.abs((d - c) - (b - a)) / (half * sampleTimeS);
    if (change > Math.max(0.002, 0.05 * Math.abs(speed)) || Math.abs(speed) < 0.001) continue;
    const bin = Math.floor(speed / BIN_M_S), newtons = steady.get(bin) ?? [];
    newtons.push(data.newtons[0][at]);
    if (newtons.length > BIN_ROWS) newtons.shift();
    steady.set(bin, newtons);
  }
}

function medians() {
  const found = [...steady].filter(([, newtons]) => newtons.length >= FEWEST).sort((a, b) => a[0] - b[0]);
  return found.map(([bin, newtons]) => [1e3 * BIN_M_S * (bin + 0.5), [...newtons].sort((a, b) => a - b)[newtons.length >> 1]]);
}

/* Whether no sample is missing within so many rows before and behind one. */
function whole(at, rows) { return data.index[at + rows] - data.index[at - rows] === 2 * rows; }

function velocity() {
  const half = Math.round(SLOPE_S / sampleTimeS / 2), x = data.samples[2];
  return x.map((_, at) => (x[at - half] == null || x[at + half] == null || !whole(at, half)) ? null : (x[at + half] - x[at - half]) / (2 * half * sampleTimeS));
}

function redraw() {
  if (!plots) return;
  const time = data.index.map((index) => index * sampleTimeS);
  const [friction, lower, upper] = data.newtons.map((column) => column.map((value, at) => usable(data.flags[at]) ? value : null));
  plots.friction.setData([time, lower, upper, friction]);
  plots.inputs.setData([time, data.samples[0].map(bar), data.samples[1].map(bar), data.samples[2].map((x) => x === null ? null : 1e3 * x)]);
  const speeds = velocity(), pairs = [];
  for (let at = 0; at < speeds.length; at += 4) if (speeds[at] !== null && usable(data.flags[at])) pairs.push([1e3 * speeds[at], data.newtons[0][at]]);
  const all = [...pairs.map(([v, f]) => [v, f]), ...medians().map(([v, f]) => [v, null, v > 0 ? f : null, v < 0 ? f : null]), ...identified(pairs)];
  all.sort((a, b) => a[0] - b[0]);
  plots.velocity.setData(plots.velocity.series.map((_, at) => all.map((row) => row[at] ?? null)));
  strip();
}

/* The identified curves over the velocities that are seen, each in a column of its own. */
function identified(pairs) {
  if (!pairs.length) return [];
  const fastest = pairs.reduce((most, [v]) => Math.max(most, Math.abs(v)), 10);
  return applying().map((name) => stribeck[name]).flatMap((line, at) => line.velocity_m_s.map((v, place) => {
    const row = [1e3 * v, null, null, null];
    row[4 + at] = line.friction_n[place];
    return row;
  })).filter(([v]) => Math.abs(v) <= fastest);
}

/* An offset that is not known yet is in the bounds; with any other flag the newtons are not friction as it is. */
function usable(flags) { return !(flags & ~512); }

function bar(pascal) { return pascal === null ? null : pascal / 1e5; }

function strip() {
  const canvas = by("flags"), plot = plots.friction, pen = canvas.getContext("2d"), ratio = devicePixelRatio;
  canvas.width = canvas.clientWidth * ratio;
  pen.clearRect(0, 0, canvas.width, canvas.height);
  const used = new Set(), left = plot.over.offsetLeft;
  data.flags.forEach((flags, at) => {
    if (!flags) return;
    const x = (left + plot.valToPos(data.index[at] * sampleTimeS, "x")) * ratio;
    flagNames.forEach((name, bit) => { if (flags >> bit & 1) { used.add(bit); pen.fillStyle = colourOf(bit); } });
    pen.fillRect(x, 0, Math.max(1, ratio), canvas.height);
  });
  const legend = [...used].sort((a, b) => a - b).map((bit) => `<span><i style="background:${colourOf(bit)}"></i>${spoken(flagNames[bit])}</span>`);
  by("legend").innerHTML = legend.length ? `Flags: ${legend.join("")}` : "No flags.";
}

function makePlots() {
  if (plots) Object.values(plots).forEach((plot) => plot.destroy());
  const ink = css("--ink"), line = css("--line"), mark = css("--mark"), warn = css("--warn");
  const axis = (label, more) => ({ label, stroke: ink, grid: { stroke: line, width: 1 }, ticks: { stroke: line }, labelSize: 20, font: "12px system-ui", labelFont: "12px system-ui", ...more });
  const clock = axis("time [s]");
  const make = (id, height, options, empty) => new uPlot({ width: by(id).clientWidth, height, ...options }, empty, by(id));
  const x = { time: false }, zoomed = { setSelect: [(plot) => { if (plot.select.width > 0) freeze(true); }], ready: [(plot) => plot.over.addEventListener("dblclick", () => freeze(false))] };
  const together = { sync: { key: "time", scales: ["x", null] } };
  plots = {
    friction: make("friction", 300, {
      title: "Friction with its bounds, rows without flags", scales: { x }, cursor: together, hooks: { ...zoomed, setScale: [(_, key) => { if (key === "x" && plots) strip(); }] }, axes: [clock, axis("[N]")],
      series: [{ label: "time [s]" }, { label: "lower", stroke: "transparent" }, { label: "upper", stroke: "transparent" }, { label: "friction [N]", stroke: mark, width: 1.5 }],
      bands: [{ series: [2, 1], fill: mark + "40" }],
    }, [[], [], [], []]),
    inputs: make("inputs", 240, {
      title: "Pressures and position", scales: { x, mm: {} }, cursor: together, hooks: zoomed, axes: [clock, axis("[bar]"), axis("[mm]", { scale: "mm", side: 1, grid: { show: false } })],
      series: [{ label: "time [s]" }, { label: "pressure 1 [bar]", stroke: mark }, { label: "pressure 2 [bar]", stroke: warn }, { label: "position [mm]", stroke: ink, scale: "mm", dash: [4, 3] }],
    }, [[], [], [], []]),
    velocity: make("velocity", 240, {
      title: "Friction against velocity, rows without flags", scales: { x }, hooks: zoomed, axes: [axis("velocity [mm/s]"), axis("[N]")],
      series: [{ label: "velocity [mm/s]" }, { label: "friction [N]", stroke: mark, paths: () => null, points: { show: true, size: 3, fill: mark } },
        ...["extending", "retracting"].map((way) => ({ label: `median, steadily ${way} [N]`, stroke: warn, width: 2, spanGaps: true, points: { show: true, size: 5, fill: warn } })),
        ...applying().map((name) => ({ label: `identified, condition ${name} [N]`, stroke: ink, width: 1.5, dash: [6, 4], spanGaps: true, points: { show: false } }))],
    }, []),
  };
  text(by("curves"), curveWords());
  redraw();
}

function freeze(on) { frozen = on; by("freeze").setAttribute("aria-pressed", String(on)); if (!on) redraw(); }

function save() {
  const { min, max } = plots.friction.scales.x, lines = ["index,time_s,pressure_1_pa,pressure_2_pa,position_m,friction_n,lower_n,upper_n,flags"];
  data.index.forEach((index, at) => {
    const time = index * sampleTimeS;
    if (time < min || time > max || data.flags[at] === null) return;
    lines.push([index, time.toFixed(6), ...data.samples.map((column) => column[at] ?? ""), ...data.newtons.map((column) => column[at]), data.flags[at]].join(","));
  });
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([lines.join("\n") + "\n"], { type: "text/csv" }));
  link.download = `${shown.replaceAll(/[^\w.-]/g, "_")}.csv`;
  link.click();
  URL.revokeObjectURL(link.href);
}

function theme(dark) {
  document.documentElement.classList.toggle("dark", dark);
  localStorage.setItem("dark", dark);
  if (plots) makePlots();
}

by("login").onsubmit = (event) => {
  event.preventDefault();
  sessionStorage.setItem("token", by("token").value.trim());
  by("token").value = "";
  by("login").hidden = true;
  connect();
};
by("freeze").onclick = () => freeze(!frozen);
by("help").onclick = () => by("keys").showModal();
by("save").onclick = save;
by("close").onclick = hide;
by("theme").onclick = () => theme(!document.documentElement.classList.contains("dark"));
by("filter").oninput = () => { ordered = ""; };
for (const head of document.querySelectorAll("th[data-sort]")) head.firstElementChild.onclick = () => {
  sort = head.dataset.sort;
  ordered = "";
  for (const each of document.querySelectorAll("th[data-sort]")) each.setAttribute("aria-sort", each === head ? (sort === "name" ? "ascending" : "descending") : "none");
};

function step(key) {
  const visible = [...by("sessions").tBodies[0].rows].filter((row) => !row.hidden), at = visible.indexOf(document.activeElement);
  const next = { ArrowDown: at + 1, ArrowUp: at < 0 ? visible.length - 1 : at - 1, Home: 0, End: visible.length - 1 }[key];
  visible[Math.max(0, Math.min(visible.length - 1, next))]?.focus();
}

document.onkeydown = (event) => {
  const row = event.target.tagName === "TR";
  if (event.target.tagName === "INPUT") {
    if (event.key === "Escape") { by("filter").value = ""; event.target.blur(); }
    if (event.key === "ArrowDown" && event.target.id === "filter") { event.preventDefault(); step("ArrowDown"); }
    return;
  }
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  if (event.key === "?") by("keys").open ? by("keys").close() : by("keys").showModal();
  else if (by("keys").open) return;
  else if (event.key === "/") { event.preventDefault(); by("filter").focus(); }
  else if (["ArrowDown", "ArrowUp"].includes(event.key) || row && ["Home", "End"].includes(event.key)) { event.preventDefault(); step(event.key); }
  else if (event.key === "Enter" && row) show(event.target.firstChild.textContent);
  else if (event.key === "t") theme(!document.documentElement.classList.contains("dark"));
  else if (shown !== null && event.key === "Escape") hide();
  else if (shown !== null && event.key === "s") save();
  else if (shown !== null && event.key === " " && event.target.tagName !== "BUTTON") { event.preventDefault(); freeze(!frozen); }
};
addEventListener("resize", () => { if (plots) makePlots(); });
const stored = localStorage.getItem("dark");
theme(stored === null ? matchMedia("(prefers-color-scheme: dark)").matches : stored === "true");
connect();
