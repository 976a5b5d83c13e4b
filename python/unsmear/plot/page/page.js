"use strict";
// The page draws itself from the JSON in #data. Flow arrives as 16-bit integers, value = integer * scale in px/frame,
// and UNKNOWN for NaN; rows of (u, v) pairs, x to the right, y downwards.
const UNKNOWN = -32768, PATH_STEPS = 8, KERNEL_CELLS = 26, LEAST_CELL = 14;
const page = JSON.parse(document.getElementById("data").textContent);
const at = (id) => document.getElementById(id);
const [height, width] = page.size;
let current = 0, pointer = null;

function decode(text) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const view = new DataView(bytes.buffer);
  return Int16Array.from({ length: bytes.length / 2 }, (_, i) => view.getInt16(2 * i, true));
}
const fields = new Map();
function fieldOf(index) {
  const flow = page.frames[index].flow;
  if (!flow) return null;
  if (!fields.has(index)) fields.set(index, { values: decode(flow.values), scale: flow.scale });
  return fields.get(index);
}
function flowAt(field, x, y) {
  const column = Math.min(Math.max(Math.round(x), 0), width - 1), row = Math.min(Math.max(Math.round(y), 0), height - 1);
  const place = 2 * (row * width + column), u = field.values[place], v = field.values[place + 1];
  return u === UNKNOWN || v === UNKNOWN ? null : [u * field.scale, v * field.scale];
}

function canvasOf(id) {
  const canvas = at(id), shown = canvas.getBoundingClientRect(), ratio = window.devicePixelRatio || 1;
  canvas.width = Math.round(shown.width * ratio);
  canvas.height = Math.round(shown.height * ratio);
  const context = canvas.getContext("2d");
  context.scale(canvas.width / width, canvas.height / height);
  return [context, width / Math.max(shown.width, 1)];
}
function stroke(context, pixel, points, head) {
  for (const [colour, thickness] of [["#000c", 3.5], ["#fff", 1.5]]) {
    context.strokeStyle = colour;
    context.lineWidth = thickness * pixel;
    context.lineCap = "round";
    context.beginPath();
    points.forEach(([x, y], i) => (i ? context.lineTo(x, y) : context.moveTo(x, y)));
    context.stroke();
  }
  if (!head) return;
  const [x, y] = points[points.length - 1];
  context.fillStyle = "#fff";
  context.beginPath();
  context.arc(x, y, 3 * pixel, 0, 2 * Math.PI);
  context.fill();
}

// The path of a pixel during the exposure: steps along the field, half of them backward in time.
function pathOf(field, x, y) {
  const halves = [-1, 1].map((sense) => {
    const points = [];
    let [px, py] = [x, y];
    for (let step = 0; step < PATH_STEPS; step++) {
      const flow = flowAt(field, px, py);
      if (!flow) return points;
      const share = (sense * page.exposure) / (2 * PATH_STEPS);
      [px, py] = [px + flow[0] * share, py + flow[1] * share];
      points.push([px, py]);
    }
    return points;
  });
  return [...halves[0].reverse(), [x, y], ...halves[1]];
}
function drawKernels() {
  const canvas = at("kernels"), field = fieldOf(current);
  canvas.hidden = !(at("show-kernels").checked && field);
  if (canvas.hidden) return;
  const [context, pixel] = canvasOf("kernels"), cell = Math.max(LEAST_CELL, Math.max(width, height) / KERNEL_CELLS);
  for (let y = cell / 2; y < height; y += cell)
    for (let x = cell / 2; x < width; x += cell) if (flowAt(field, x, y)) stroke(context, pixel, pathOf(field, x, y));
}

function readFlow() {
  const field = fieldOf(current);
  if (!field) return;
  const [context, pixel] = canvasOf("arrow");
  if (!pointer) return;
  const [x, y] = pointer, flow = flowAt(field, x, y);
  if (!flow) {
    at("reading").textContent = `x ${x}, y ${y}: unknown`;
    return;
  }
  const [u, v] = flow, speed = Math.hypot(u, v);
  const longest = Math.min(width, height) / 5, stretch = Math.max(1, Math.min(longest / Math.max(speed, 1e-9), 8));
  stroke(context, pixel, [[x, y], [x + u * stretch, y + v * stretch]], true);
  const angle = (Math.atan2(-v, u) * 180) / Math.PI, digits = (value) => value.toFixed(3);
  at("reading").textContent =
    `x ${x}, y ${y}: u ${digits(u)}, v ${digits(v)}, speed ${digits(speed)} px/frame, direction ${angle.toFixed(1)}°`;
}

function show(index) {
  current = Math.min(Math.max(index, 0), page.frames.length - 1);
  const frame = page.frames[current];
  at("frame").value = current;
  at("frame-label").textContent = frame.label;
  at("before").src = frame.before;
  at("compare-stage").classList.toggle("whole", !frame.after);
  if (frame.after) at("after").src = frame.after;
  at("motion").hidden = !frame.flow;
  at("trust").hidden = !frame.confidence;
  if (frame.confidence) at("confidence").src = frame.confidence;
  if (frame.flow) at("flow").src = at("over-picture").checked ? frame.before : frame.flow.picture;
  drawKernels();
  readFlow();
}

function table({ title, columns, rows }) {
  const figure = document.createElement("figure"), element = document.createElement("table");
  const caption = document.createElement("figcaption");
  caption.textContent = title;
  for (const [kind, cells] of [["th", columns], ...rows.map((row) => ["td", row])]) {
    const line = element.insertRow();
    for (const text of cells) line.appendChild(document.createElement(kind)).textContent = text;
  }
  figure.append(caption, element);
  return figure;
}
function curve({ title, x, y, x_label, y_label }) {
  const [w, h, left, right, bottom] = [460, 230, 52, 26, 34], top = Math.max(...y, 1e-12) * 1.08;
  const px = (value) => left + value * (w - left - right), py = (value) => h - bottom - (value / top) * (h - bottom - 10);
  const line = x.map((value, i) => `${i ? "L" : "M"}${px(value).toFixed(1)} ${py(y[i]).toFixed(1)}`).join("");
  const marks = [0, 0.25, 0.5, 0.75, 1].map((share) =>
    `<text x="${px(share)}" y="${h - bottom + 15}" text-anchor="middle">${Math.round(100 * share)} %</text>
     <text x="${left - 6}" y="${py(share * top) + 4}" text-anchor="end">${(share * top).toPrecision(2)}</text>`).join("");
  const figure = document.createElement("figure"), caption = document.createElement("figcaption");
  caption.textContent = title;
  figure.innerHTML = `<svg viewBox="0 0 ${w} ${h}" width="${w}" role="img"><path class="axis" d="M${left} 10V${h - bottom}H${w - right}"/>
    ${marks}<path class="curve" d="${line}"/><text class="x" x="${(w + left - right) / 2}" y="${h - 4}" text-anchor="middle"></text>
    <text class="y" x="${left + 6}" y="18"></text></svg>`;
  figure.querySelector(".x").textContent = x_label;
  figure.querySelector(".y").textContent = y_label;
  figure.prepend(caption);
  return figure;
}

async function copy(button) {
  const text = at(button.dataset.copy).textContent;
  try {
    await navigator.clipboard.writeText(text);
  } catch {
    // Browsers that keep the clipboard from local files still copy a selection.
    const area = document.createElement("textarea");
    area.value = text;
    document.body.append(area);
    area.select();
    document.execCommand("copy");
    area.remove();
  }
  button.textContent = "copied";
  setTimeout(() => (button.textContent = "copy"), 1500);
}

function split(percent) {
  at("split").value = percent;
  at("compare-stage").style.setProperty("--cut", `${percent}%`);
}
function follow(event) {
  if (event.type === "pointermove" && !event.buttons) return;
  const shown = at("compare-stage").getBoundingClientRect();
  split(Math.min(Math.max((100 * (event.clientX - shown.left)) / shown.width, 0), 100));
}
function point(x, y) {
  pointer = [Math.min(Math.max(x, 0), width - 1), Math.min(Math.max(y, 0), height - 1)];
  readFlow();
}
function theme(name) {
  document.documentElement.dataset.theme = name;
}

function start() {
  document.title = at("title").textContent = page.title;
  at("facts").textContent = page.facts;
  document.documentElement.style.setProperty("--shown", `${Math.max(width, Math.min(2 * width, 640))}px`);
  at("verdicts").hidden = !page.verdicts.length;
  for (const text of page.verdicts)
    at("verdicts").querySelector("ul").appendChild(document.createElement("li")).textContent = text;
  at("frames").hidden = page.frames.length < 2;
  at("frame").max = page.frames.length - 1;
  at("legend").src = page.legend;
  at("legend").hidden = !page.legend;
  at("errors").hidden = !(page.tables.length || page.curves.length);
  at("tables").append(...page.tables.map(table));
  at("curves").append(...page.curves.map(curve));
  at("command-block").hidden = !page.command;
  at("command").textContent = page.command || "";
  at("parameters").textContent = JSON.stringify(page.parameters, null, 2);

  theme(matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
  at("theme").onclick = () => theme(document.documentElement.dataset.theme === "dark" ? "light" : "dark");
  at("previous").onclick = () => show(current - 1);
  at("next").onclick = () => show(current + 1);
  at("frame").oninput = (event) => show(Number(event.target.value));
  at("split").oninput = (event) => split(event.target.value);
  at("show-kernels").onchange = drawKernels;
  at("over-picture").onchange = () => show(current);
  for (const name of ["pointerdown", "pointermove"]) at("compare-stage").addEventListener(name, follow);
  at("flow-stage").addEventListener("pointermove", (event) => {
    const shown = at("flow-stage").getBoundingClientRect();
    point(Math.floor(((event.clientX - shown.left) / shown.width) * width),
      Math.floor(((event.clientY - shown.top) / shown.height) * height));
  });
  at("flow-stage").addEventListener("keydown", (event) => {
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (!step) return;
    event.preventDefault();
    event.stopPropagation();
    const [x, y] = pointer || [Math.floor(width / 2), Math.floor(height / 2)];
    point(x + step[0], y + step[1]);
  });
  document.addEventListener("keydown", (event) => {
    if (["INPUT", "PRE"].includes(event.target.tagName)) return;
    if (event.key === "ArrowLeft") show(current - 1);
    if (event.key === "ArrowRight") show(current + 1);
  });
  for (const button of document.querySelectorAll(".copy")) button.onclick = () => copy(button);
  window.addEventListener("resize", () => show(current));
  for (const id of ["before", "flow"]) at(id).addEventListener("load", () => (drawKernels(), readFlow()));
  split(50);
  show(0);
}
start();
