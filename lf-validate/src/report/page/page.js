"use strict";
// For both views: colours, numbers and arrows.
const INK = "#191923";
const RISING = [[68, 1, 84], [71, 45, 123], [59, 82, 139], [44, 114, 142], [33, 145, 140], [40, 174, 128], [94, 201, 98],
  [173, 220, 48], [253, 231, 37]];
function colour(table, share) {
  const at = Math.min(Math.max(share, 0), 1) * (table.length - 1), low = Math.min(Math.floor(at), table.length - 2);
  const mix = [0, 1, 2].map((c) => Math.round(table[low][c] + (table[low + 1][c] - table[low][c]) * (at - low)));
  return "rgb(" + mix.join(",") + ")";
}
function short(value) {
  if (!isFinite(value)) return "none";
  const isFar = Math.abs(value) >= 1e5 || (value !== 0 && Math.abs(value) < 1e-3);
  return isFar ? value.toExponential(2) : String(+value.toPrecision(3));
}
// A displacement or a velocity, with the pixels of the focal plane that it is per frame interval where a camera is known.
function both(value, { unit, px }) {
  return short(value) + " " + unit + (px ? " = " + short(value * px) + " px" + (unit === "mm" ? "" : " a frame") : "");
}
// Round numbers between two ends.
function ticks(low, high, most) {
  const rough = (high - low) / most, power = Math.pow(10, Math.floor(Math.log10(rough)));
  const step = [1, 2, 5, 10].map((n) => n * power).find((step) => step >= rough) || rough;
  const found = [];
  for (let n = Math.ceil(low / step - 1e-9); n * step <= high + 1e-9 * step; n++) found.push(+(n * step).toPrecision(12));
  return found;
}
// The largest round number that is not above a value.
function roundBelow(value) {
  const power = Math.pow(10, Math.floor(Math.log10(value)));
  return +(([5, 2].find((n) => n * power <= value) || 1) * power).toPrecision(3);
}
// An arrow is hollow if it has another filling than its ink.
function arrow(pen, x, y, dx, dy, ink, filling) {
  const isHollow = ink !== filling, length = Math.hypot(dx, dy) || 1;
  const head = Math.min(5, 0.45 * length), wing = 0.5 * head;
  const [ex, ey] = [dx / length, dy / length], neck = [x + dx - head * ex, y + dy - head * ey];
  pen.strokeStyle = ink;
  pen.fillStyle = filling;
  pen.lineWidth = isHollow ? 0.8 : 1.3;
  pen.setLineDash(isHollow ? [2, 2] : []);
  pen.beginPath();
  pen.moveTo(x, y);
  pen.lineTo(neck[0], neck[1]);
  pen.stroke();
  pen.setLineDash([]);
  pen.beginPath();
  pen.moveTo(x + dx, y + dy);
  pen.lineTo(neck[0] - wing * ey, neck[1] + wing * ex);
  pen.lineTo(neck[0] + wing * ey, neck[1] - wing * ex);
  pen.closePath();
  pen.fill();
  if (isHollow) pen.stroke();
}

// The view of a field: one layer across an axis, a scalar in colours, arrows over it.
(function () {
  const holder = document.getElementById("fields-data");
  if (!holder) return;
  const fields = JSON.parse(holder.textContent);
  const get = (id) => document.getElementById(id);
  const canvas = get("view"), reading = get("reading"), place = get("place");
  const AXES = ["x", "y", "z"], NAMES = ["u", "v", "w"];
  const SIGNED = [[62, 118, 186], [126, 168, 214], [192, 213, 234], [248, 247, 244], [247, 208, 188], [230, 150, 124], [202, 86, 70]];
  const MEASURED = 0, REPLACED = 1, NO_DATA = 2, MISSING = -32768;

  // Numbers of a field: whole numbers of 16 bits, little-endian, times a scale; the least of them is no number.
  function unpack(packed) {
    const text = atob(packed.data), values = new Float32Array(text.length / 2);
    for (let n = 0; n < values.length; n++) {
      let whole = text.charCodeAt(2 * n) | (text.charCodeAt(2 * n + 1) << 8);
      if (whole > 32767) whole -= 65536;
      values[n] = whole === MISSING ? NaN : whole * packed.scale;
    }
    return values;
  }
  function open(field) {
    if (!field.open) {
      field.open = { vector: field.vector.map(unpack), uncertainty: field.uncertainty.map(unpack) };
      const flags = atob(field.flags);
      field.open.flag = Uint8Array.from(flags, (letter) => letter.charCodeAt(0));
      field.open.ranges = {};
    }
    return field.open;
  }

  const index = (field, at) => at[0] + field.shape[0] * (at[1] + field.shape[1] * at[2]);
  const known = (data, n) => data.flag[n] !== NO_DATA;

  // Central differences of the displacement; one-sided at the ends.
  function slope(field, data, component, at, axis) {
    const step = (by) => {
      const there = at.slice();
      there[axis] += by;
      if (there[axis] < 0 || there[axis] >= field.shape[axis]) return null;
      const n = index(field, there);
      return known(data, n) ? [data.vector[component][n], by] : null;
    };
    const here = [data.vector[component][index(field, at)], 0];
    const [low, high] = [step(-1) || here, step(1) || here];
    return high[1] === low[1] ? NaN : (high[0] - low[0]) / ((high[1] - low[1]) * field.spacing[axis]);
  }
  function scalar(field, data, kind, through, at) {
    const n = index(field, at);
    if (!known(data, n)) return NaN;
    const component = NAMES.indexOf(kind);
    if (component >= 0) return data.vector[component][n];
    if (kind === "speed") return Math.hypot(...[0, 1, 2].map((c) => data.vector[c][n]));
    if (kind === "uncertainty") return Math.hypot(...[0, 1, 2].map((c) => data.uncertainty[c][n]));
    if (kind === "flag") return data.flag[n];
    const [a, b] = [(through + 1) % 3, (through + 2) % 3];
    return slope(field, data, b, at, a) - slope(field, data, a, at, b);
  }
  const isSigned = (kind) => NAMES.includes(kind) || kind === "vorticity";
  function unit(field, kind) {
    if (kind === "flag") return "";
    if (kind === "vorticity") return field.dt ? "1/s" : "1";
    return field.unit;
  }
  // The end of the colours: 98 % of all values of the field are below it, so that layers can be compared.
  function range(field, kind, through) {
    if (kind === "flag") return [0, 2];
    const data = open(field), key = kind + through;
    if (!data.ranges[key]) {
      const sizes = [];
      for (let z = 0; z < field.shape[2]; z++)
        for (let y = 0; y < field.shape[1]; y++)
          for (let x = 0; x < field.shape[0]; x++) {
            const value = Math.abs(scalar(field, data, kind, through, [x, y, z]));
            if (isFinite(value)) sizes.push(value);
          }
      sizes.sort((one, other) => one - other);
      data.ranges[key] = sizes.length ? sizes[Math.floor(0.98 * (sizes.length - 1))] || 1 : 1;
    }
    const most = data.ranges[key];
    return isSigned(kind) ? [-most, most] : [0, most];
  }

  let view = null;
  function draw() {
    const field = fields[+get("which").value], data = open(field), through = AXES.indexOf(get("axis").value);
    const across = [0, 1, 2].filter((axis) => axis !== through), layer = +get("layer").value;
    const [nx, ny] = across.map((axis) => field.shape[axis]);
    const kind = get("scalar").value;
    let ends = range(field, kind, through);
    const typed = [get("low"), get("high")].map((input) => (input.value === "" ? NaN : +input.value));
    ends = ends.map((end, n) => (isFinite(typed[n]) ? typed[n] : end));
    if (ends[0] >= ends[1]) ends[1] = ends[0] + 1e-9;
    const table = isSigned(kind) && ends[0] === -ends[1] ? SIGNED : RISING;
    const share = (value) => (value - ends[0]) / (ends[1] - ends[0]);

    // The frame, to scale.
    const width = canvas.clientWidth, ratio = window.devicePixelRatio || 1;
    const left = 58, right = 92, top = 12, bottom = 46;
    const sides = across.map((axis) => field.shape[axis] * field.spacing[axis]);
    const stretch = Math.min(Math.max(sides[1] / sides[0], 0.25), 1.6);
    const highest = Math.max(260, 0.75 * window.innerHeight);
    const inner = Math.min(Math.max(width - left - right, 60), highest / stretch), height = inner * stretch;
    canvas.style.height = height + top + bottom + "px";
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round((height + top + bottom) * ratio);
    const pen = canvas.getContext("2d");
    pen.scale(ratio, ratio);
    pen.font = "13px system-ui, DejaVu Sans, sans-serif";
    const cell = [inner / nx, height / ny];
    const corner = (i, j) => [left + i * cell[0], top + height - (j + 1) * cell[1]];
    const at = (i, j) => {
      const found = [0, 0, 0];
      [found[through], found[across[0]], found[across[1]]] = [layer, i, j];
      return found;
    };

    const counts = [0, 0, 0];
    for (let j = 0; j < ny; j++)
      for (let i = 0; i < nx; i++) {
        const [x, y] = corner(i, j), here = at(i, j), n = index(field, here);
        counts[data.flag[n]]++;
        const value = scalar(field, data, kind, through, here);
        pen.fillStyle = isFinite(value) ? colour(table, share(value)) : "#cdcdcd";
        pen.fillRect(x, y, cell[0] + 0.6, cell[1] + 0.6);
        if (!known(data, n)) {
          pen.strokeStyle = "#8a8a8a";
          pen.lineWidth = 1;
          pen.beginPath();
          pen.moveTo(x, y + cell[1]);
          pen.lineTo(x + cell[0], y);
          pen.stroke();
        }
      }

    // Arrows: as many as have room, never longer than the distance between two of them.
    let stated = "";
    if (get("arrows").checked) {
      const room = 15, every = cell.map((side) => Math.max(1, Math.ceil(room / side)));
      const reach = Math.min(cell[0] * every[0], cell[1] * every[1]) * 0.92;
      const most = Math.max(...across.map((axis) => range(field, NAMES[axis], through)[1])) * Math.SQRT2;
      for (let j = Math.floor(((ny - 1) % every[1]) / 2); j < ny; j += every[1])
        for (let i = Math.floor(((nx - 1) % every[0]) / 2); i < nx; i += every[0]) {
          const n = index(field, at(i, j));
          if (!known(data, n)) continue;
          let [du, dv] = across.map((axis) => data.vector[axis][n]);
          const size = Math.hypot(du, dv), length = Math.min(size / most, 1) * reach;
          if (!(size > 0)) continue;
          du *= length / size;
          dv *= length / size;
          const [x, y] = corner(i, j), middle = [x + cell[0] / 2, y + cell[1] / 2];
          arrow(pen, middle[0] - du / 2, middle[1] + dv / 2, du, -dv, INK, data.flag[n] === REPLACED ? "#fff" : INK);
        }
      const reference = roundBelow(most);
      arrow(pen, left + inner + 14, top + height + 14, (reference / most) * reach, 0, INK, INK);
      pen.fillText(short(reference) + " " + field.unit, left + inner + 14, top + height + 36);
      stated = ". The arrow below the colours is " + both(reference, field);
    }

    // Axes and the bar of colours.
    pen.strokeStyle = pen.fillStyle = "#191923";
    pen.lineWidth = 1;
    pen.strokeRect(left, top, inner, height);
    const bounds = across.map((axis) => field.origin[axis] - 0.5 * field.spacing[axis]);
    pen.textAlign = "center";
    pen.textBaseline = "top";
    for (const tick of ticks(bounds[0], bounds[0] + sides[0], Math.max(2, inner / 70))) {
      const x = left + ((tick - bounds[0]) / sides[0]) * inner;
      pen.fillRect(x, top + height, 1, 5);
      pen.fillText(short(tick), x, top + height + 7);
    }
    pen.fillText(AXES[across[0]] + ", mm", left + inner / 2, top + height + 25);
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    for (const tick of ticks(bounds[1], bounds[1] + sides[1], Math.max(2, height / 50))) {
      const y = top + height - ((tick - bounds[1]) / sides[1]) * height;
      pen.fillRect(left - 5, y, 5, 1);
      pen.fillText(short(tick), left - 8, y);
    }
    upright(pen, AXES[across[1]] + ", mm", 10, top + height / 2);
    for (let y = 0; y < height; y++) {
      pen.fillStyle = colour(table, 1 - y / height);
      pen.fillRect(left + inner + 14, top + y, 14, 1.5);
    }
    pen.fillStyle = "#191923";
    pen.strokeRect(left + inner + 14, top, 14, height);
    pen.textAlign = "left";
    for (const tick of ticks(ends[0], ends[1], Math.max(2, height / 50))) {
      const y = top + height * (1 - share(tick));
      pen.fillRect(left + inner + 28, y, 4, 1);
      pen.fillText(short(tick), left + inner + 35, y);
    }
    const name = kind === "uncertainty" ? "standard uncertainty" : kind;
    upright(pen, name + (unit(field, kind) ? ", " + unit(field, kind) : ""), left + inner + 84, top + height / 2);

    const mm = field.origin[through] + layer * field.spacing[through];
    place.textContent = "layer " + (layer + 1) + " of " + field.shape[through] + ", " + AXES[through] + " = " + short(mm) + " mm";
    const counted = counts[MEASURED] + " measured, " + counts[REPLACED] + " replaced (hollow arrows), " + counts[NO_DATA] +
      " without data (grey, crossed out)" + stated;
    reading.textContent = counted + ". Point at the picture to read a vector.";
    view = { field, data, through, across, layer, cell, left, top, inner, height, nx, ny, at, counted };
  }
  function upright(pen, text, x, y) {
    pen.save();
    pen.translate(x, y);
    pen.rotate(-Math.PI / 2);
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    pen.fillText(text, 0, 0);
    pen.restore();
  }

  function point(event) {
    if (!view) return;
    const box = canvas.getBoundingClientRect(), { field, data, cell } = view;
    const i = Math.floor((event.clientX - box.left - view.left) / cell[0]);
    const j = Math.floor((view.top + view.height - (event.clientY - box.top)) / cell[1]);
    if (i < 0 || j < 0 || i >= view.nx || j >= view.ny) {
      reading.textContent = view.counted + ". Point at the picture to read a vector.";
      return;
    }
    const there = view.at(i, j), n = index(field, there);
    const where = there.map((step, axis) => AXES[axis] + " " + short(field.origin[axis] + step * field.spacing[axis])).join(", ");
    const kind = ["measured", "replaced", "no data"][data.flag[n]];
    const values = NAMES.map((name, c) => {
      const spread = data.uncertainty[c][n];
      return name + " " + short(data.vector[c][n]) + (isFinite(spread) ? " \u00b1 " + short(spread) : "");
    });
    const px = field.px ? " = " + NAMES.map((_, c) => short(data.vector[c][n] * field.px)).join(", ") + " px" : "";
    reading.textContent = where + " mm: " + (known(data, n) ? values.join(", ") + " " + field.unit + px + " (" + kind + ")" : kind);
  }

  // The layer that shows most: the largest vectors for their uncertainty, among the layers with nearly as many measured
  // vectors as the fullest. Of layers that are nearly as good, the one nearest to the middle.
  function best(field, through) {
    const data = open(field), across = [0, 1, 2].filter((axis) => axis !== through);
    const scores = [];
    for (let layer = 0; layer < field.shape[through]; layer++) {
      let [count, motion, doubt] = [0, 0, 0];
      for (let j = 0; j < field.shape[across[1]]; j++)
        for (let i = 0; i < field.shape[across[0]]; i++) {
          const at = [0, 0, 0];
          [at[through], at[across[0]], at[across[1]]] = [layer, i, j];
          const n = index(field, at);
          if (data.flag[n] !== MEASURED) continue;
          count++;
          motion += [0, 1, 2].reduce((sum, c) => sum + data.vector[c][n] ** 2, 0);
          const stated = [0, 1, 2].reduce((sum, c) => sum + data.uncertainty[c][n] ** 2, 0);
          doubt += isFinite(stated) ? stated : 0;
        }
      scores.push([count, doubt > 0 ? motion / doubt : motion]);
    }
    const most = Math.max(...scores.map((score) => score[0]));
    const value = (score) => (score[0] >= 0.8 * most ? score[1] : -1);
    const good = 0.8 * Math.max(0, ...scores.map(value)), middle = Math.floor(scores.length / 2);
    const far = (n) => Math.abs(n - middle);
    const fit = scores.map((_, n) => n).filter((n) => value(scores[n]) >= good);
    return fit.length ? fit.reduce((found, n) => (far(n) < far(found) ? n : found)) : middle;
  }
  function settle() {
    const field = fields[+get("which").value], through = AXES.indexOf(get("axis").value), layer = get("layer");
    layer.max = field.shape[through] - 1;
    layer.value = best(field, through);
    draw();
  }
  function forget() {
    get("low").value = get("high").value = "";
    draw();
  }
  get("which").addEventListener("change", settle);
  get("axis").addEventListener("change", settle);
  get("scalar").addEventListener("change", forget);
  get("reset").addEventListener("click", forget);
  for (const id of ["layer", "arrows", "low", "high"]) get(id).addEventListener("input", draw);
  canvas.addEventListener("pointermove", point);
  canvas.addEventListener("pointerdown", point);
  canvas.addEventListener("keydown", (event) => {
    const by = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1 }[event.key];
    if (!by) return;
    event.preventDefault();
    get("layer").value = +get("layer").value + by;
    draw();
  });
  window.addEventListener("resize", draw);
  window.addEventListener("beforeprint", draw);
  settle();
})();
