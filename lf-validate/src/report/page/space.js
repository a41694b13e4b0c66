// The volume from any side: its box, particles as dots, vectors as arrows coloured by speed. The projection is
// parallel, so that the reference arrow holds everywhere.
(function () {
  const holder = document.getElementById("space-data");
  if (!holder) return;
  const data = JSON.parse(holder.textContent), get = (id) => document.getElementById(id);
  const canvas = get("spaceview"), pen = canvas.getContext("2d");
  const PAPER = "#14141c", LIGHT = "#e6e6ee", FAINT = "#5d5d70";
  const [middle, half] = [1, -1].map((sign) => data.box.map(([low, high]) => (high + sign * low) / 2));
  const speeds = data.vectors.map((vector) => Math.hypot(...vector.slice(3, 6)));
  const sorted = speeds.slice().sort((one, other) => one - other);
  const most = sorted[Math.floor(0.98 * (sorted.length - 1))] || 1, reference = roundBelow(most);
  let [turned, tilted] = [0.6, 0.35];

  // From millimetres about the middle of the box to px to the right, px upwards, and millimetres towards the viewer.
  function projection(width, height) {
    const depth = +get("depth").value, round = Math.hypot(half[0], half[2] * depth);
    const [ct, st, cp, sp] = [Math.cos(turned), Math.sin(turned), Math.cos(tilted), Math.sin(tilted)];
    const high = half[1] * Math.abs(cp) + round * Math.abs(sp);
    const scale = Math.min((width - 130) / (2 * round), (height - 150) / (2 * high)) * get("zoom").value;
    const project = ([x, y, z]) => {
      const near = z * depth * ct - x * st;
      return [(x * ct + z * depth * st) * scale, (y * cp - near * sp) * scale, y * sp + near * cp];
    };
    const screen = (at) => {
      const [right, up, near] = project(at.map((value, axis) => value - middle[axis]));
      return [width / 2 + right, height / 2 - 18 - up, near];
    };
    return { scale, project, screen, reach: Math.hypot(round, half[1]) };
  }

  function draw() {
    const width = canvas.clientWidth, ratio = window.devicePixelRatio || 1;
    const height = Math.round(Math.min(Math.max(0.6 * width, 360), 0.8 * window.innerHeight));
    canvas.style.height = height + "px";
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
    pen.scale(ratio, ratio);
    pen.fillStyle = PAPER;
    pen.fillRect(0, 0, width, height);
    pen.font = "13px system-ui, DejaVu Sans, sans-serif";
    const { scale, project, screen, reach } = projection(width, height);
    const stretch = (data.step / most) * get("length").value, least = (get("slower").value / 100) * most;
    box(screen);

    // Particles and arrows, the far ones first and fainter.
    const things = get("showparticles").checked ? data.particles.map((place) => [screen(place), -1]) : [];
    if (get("showvectors").checked)
      data.vectors.forEach((vector, n) => speeds[n] >= least && things.push([screen(vector.slice(0, 3)), n]));
    things.sort((one, other) => one[0][2] - other[0][2]);
    for (const [[x, y, near], n] of things) {
      pen.globalAlpha = 0.65 + (0.35 * near) / reach;
      if (n < 0) {
        pen.fillStyle = LIGHT;
        pen.fillRect(x - 0.9, y - 0.9, 1.8, 1.8);
      } else {
        const [dx, dy] = project(data.vectors[n].slice(3, 6).map((value) => value * stretch));
        const ink = colour(RISING, speeds[n] / most), isReplaced = data.vectors[n][6];
        arrow(pen, x - dx / 2, y + dy / 2, dx, -dy, ink, isReplaced ? PAPER : ink);
      }
    }
    pen.globalAlpha = 1;
    if (data.vectors.length) legend(width, height, reference * stretch * scale);
    for (const id of ["depth", "zoom"]) get(id + "now").textContent = "\u00d7 " + get(id).value;
    get("lengthnow").textContent = short(stretch / data.dt) + " \u00d7 the displacement";
    get("slowernow").textContent = short(least) + " " + data.unit;
  }

  // The twelve edges. Of the four along an axis one has the scale: the lowest along x and z, the leftmost along y.
  function box(screen) {
    const [cx, cy] = screen(middle);
    pen.lineWidth = 1;
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    const line = (from, to, ink) => {
      pen.strokeStyle = ink;
      pen.beginPath();
      pen.moveTo(from[0], from[1]);
      pen.lineTo(to[0], to[1]);
      pen.stroke();
    };
    for (const axis of [0, 1, 2]) {
      const [a, b] = [(axis + 1) % 3, (axis + 2) % 3];
      const edges = [[0, 0], [0, 1], [1, 0], [1, 1]].map(([i, j]) => {
        const point = [0, 0, 0];
        [point[a], point[b]] = [data.box[a][i], data.box[b][j]];
        const at = (value) => screen(point.map((other, n) => (n === axis ? value : other)));
        const [from, to, centre] = [...data.box[axis], middle[axis]].map(at);
        line(from, to, FAINT);
        return { at, centre, along: [to[0] - from[0], to[1] - from[1]], rank: axis === 1 ? -centre[0] : centre[1] };
      });
      const { at, centre, along } = edges.reduce((best, edge) => (edge.rank > best.rank ? edge : best));
      const size = Math.hypot(...along);
      if (size < 30) continue;
      // Across the edge, away from the middle.
      const side = along[0] * (centre[1] - cy) - along[1] * (centre[0] - cx) < 0 ? -1 : 1;
      const out = [(-along[1] / size) * side, (along[0] / size) * side];
      pen.fillStyle = LIGHT;
      for (const tick of ticks(...data.box[axis], Math.max(2, size / 60))) {
        const [x, y] = at(tick);
        line([x, y], [x + 5 * out[0], y + 5 * out[1]], LIGHT);
        pen.fillText(short(tick), x + 17 * out[0], y + 14 * out[1]);
      }
      pen.fillText("xyz"[axis] + ", mm", Math.max(22, centre[0] + 50 * out[0]), centre[1] + 32 * out[1]);
    }
  }

  // The reference arrow, and the colours above it at the right.
  function legend(width, height, length) {
    const side = Math.min(160, width / 3), left = width - side - 14;
    arrow(pen, 14, height - 32, length, 0, LIGHT, LIGHT);
    for (let x = 0; x < side; x++) {
      pen.fillStyle = colour(RISING, x / side);
      pen.fillRect(left + x, height - 56, 1.5, 9);
    }
    pen.fillStyle = LIGHT;
    pen.textAlign = "left";
    pen.fillText(both(reference, data), 14, height - 15);
    pen.textAlign = "right";
    pen.fillText("speed to " + short(most) + " " + data.unit, left + side, height - 67);
  }

  function turn(right, down) {
    turned += right;
    tilted = Math.min(Math.max(tilted + down, -Math.PI / 2), Math.PI / 2);
    requestAnimationFrame(draw);
  }
  // Mouse, pen or finger: the one that went down last turns the volume.
  let held = null;
  canvas.addEventListener("pointerdown", (event) => (held = event));
  window.addEventListener("pointermove", (event) => {
    if (!held || event.pointerId !== held.pointerId) return;
    turn((event.clientX - held.clientX) / 150, (event.clientY - held.clientY) / 150);
    held = event;
  });
  for (const end of ["pointerup", "pointercancel"]) window.addEventListener(end, () => (held = null));
  canvas.addEventListener("keydown", (event) => {
    const by = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] }[event.key];
    if (!by) return;
    event.preventDefault();
    turn(...by);
  });
  const sides = { alongx: [-Math.PI / 2, 0], alongy: [0, Math.PI / 2], alongz: [0, 0] };
  for (const id in sides) get(id).addEventListener("click", () => turn(sides[id][0] - turned, sides[id][1] - tilted));
  get("spacecontrols").addEventListener("input", draw);
  for (const moment of ["resize", "beforeprint"]) window.addEventListener(moment, draw);
  draw();
})();
