/* Long signals: a button at the drawing sets uPlot in its place. Drag, pinch, buttons and keys zoom; the drawing stays for print. */
(() => {
  "use strict";
  const source = document.getElementById("zoom");
  if (!source) return;
  const { arrays, panels } = JSON.parse(source.textContent);
  const MISSING = 0xffffff, LEAST = 1e-5, STEP = 0.2, SHAPES_ON_A_LINE = 6, DOTS_FROM = 600;
  const SIGNS = { "-": "⁻", 0: "⁰", 1: "¹", 2: "²", 3: "³", 4: "⁴", 5: "⁵", 6: "⁶", 7: "⁷", 8: "⁸", 9: "⁹" };
  const open = new Set();

  const unpacked = [];
  function numbers(place) {
    if (place === undefined || unpacked[place]) return unpacked[place];
    const { n, first, step, codes, log } = arrays[place], found = new Float64Array(n);
    const raw = codes === undefined ? null : atob(codes);
    for (let i = 0; i < n; i++) {
      const code = raw === null ? i : (raw.charCodeAt(3 * i) << 16) | (raw.charCodeAt(3 * i + 1) << 8) | raw.charCodeAt(3 * i + 2);
      found[i] = raw !== null && code === MISSING ? NaN : first + step * code;
    }
    return (unpacked[place] = log ? found.map((value) => 10 ** value) : found);
  }

  const make = (name, kind, text = "") => Object.assign(document.createElement(name), { className: kind, textContent: text });
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const fixed = (value, decimals) => (Number(value.toFixed(decimals)) + 0 === 0 ? 0 : value).toFixed(decimals).replace("-", "−");

  /* So many places behind the point that multiples of `step` differ, and are told whole where it is round. */
  function decimals(step) {
    const least = Math.min(Math.max(Math.ceil(-Math.log10(step) - 1e-9), 0), 12);
    return Math.abs(Number(step.toFixed(least)) - step) > 1e-6 * step ? least + 1 : least;
  }

  /* A number with the digits that the range shown can tell apart. */
  function told(value, low, high, log) {
    if (log) return value === 0 ? "0" : power(value, 4);
    return fixed(value, decimals(10 ** Math.floor(Math.log10((high - low) / 200))));
  }

  function power(value, digits) {
    const exponent = Math.floor(Math.log10(Math.abs(value)) + 1e-9);
    if (exponent >= -3 && exponent < 4) return String(Number(value.toPrecision(digits))).replace("-", "−");
    const ten = "10" + [...String(exponent)].map((sign) => SIGNS[sign]).join("");
    const factor = Number((value / 10 ** exponent).toPrecision(digits));
    return factor === 1 ? ten : `${factor}×${ten}`;
  }

  /* The first place of rising numbers that is not below `value`. */
  function from(xs, value) {
    let low = 0, high = xs.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (xs[middle] < value) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  class View {
    constructor(box, panel) {
      this.box = box;
      this.panel = panel;
      this.marks = panel.marks.map((mark) => {
        const own = { ...mark };
        for (const name of ["x", "y", "low", "high", "left", "right"]) if (mark.kind !== "rule") own[name] = numbers(mark[name]);
        own.rises = mark.kind !== "rule" && own.x.every((x, i) => i === 0 || x >= own.x[i - 1]);
        return own;
      });
      const drawing = box.firstElementChild.getBoundingClientRect();
      this.root = make("div", "zoom-view");
      this.root.tabIndex = 0;
      this.root.setAttribute("role", "application");
      this.root.setAttribute("aria-label", `${panel.name}, enlarged. Plus and minus zoom, arrow keys move, Escape goes back.`);
      if (panel.title) this.root.append(make("p", "zoom-title", panel.title));
      this.stage = make("div", "zoom-stage");
      this.root.append(this.stage, this.legend(), this.tools());
      box.append(this.root);
      box.classList.add("zoomed");
      this.low = panel.x.low;
      this.high = panel.x.high;
      this.plot = new uPlot(this.options(drawing), [[panel.x.low, panel.x.high], [null, null]], this.stage);
      this.plot.over.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
      this.touches();
      this.root.addEventListener("keydown", (event) => this.key(event));
      this.sizes = new ResizeObserver(() => box.clientWidth && this.plot.setSize({ width: box.clientWidth, height: this.plot.height }));
      this.sizes.observe(box);
      this.tell();
      open.add(this);
      this.root.focus({ preventScroll: true });
    }

    options(drawing) {
      const { x, y, figure, shared } = this.panel, font = `13px ${getComputedStyle(document.body).fontFamily}`;
      const axis = (own, more) => ({
        label: own.label, font, labelFont: font, labelSize: 20, labelGap: 0, gap: 5, border: { show: true, stroke: () => colour("--quiet"), width: 1 }, stroke: () => colour("--ink"),
        grid: { stroke: () => colour("--grid"), width: 1 }, ticks: { show: false },
        values: (u, places, at, space, step) =>
          places.map((place) => (place === null ? "" : own.log ? power(place, 3) : fixed(place, decimals(step)))),
        ...more,
      });
      const scale = (own) => ({ time: false, auto: false, distr: own.log ? 3 : 1, min: own.low, max: own.high, range: (u, low, high) => [low, high] });
      const widest = (u, texts, at, cycle) => {
        if (cycle > 1) return u.axes[at]._size;
        u.ctx.font = u.axes[at].font[0];
        return 12 + Math.max(...(texts || []).map((text) => u.ctx.measureText(text).width / devicePixelRatio), 16);
      };
      return {
        width: this.box.clientWidth, height: Math.max(drawing.height, 240), padding: [10, 14, 0, 0],
        scales: { x: scale(x), y: scale(y) },
        axes: [axis(x, { size: 26 }), axis(y, { size: widest })],
        series: [{}, { scale: "y", paths: () => null, points: { show: false } }],
        legend: { show: false },
        cursor: {
          points: { show: false }, y: false, drag: { x: true, y: true, uni: 24, setScale: false },
          bind: { dblclick: () => () => this.show(x.low, x.high) },
          sync: shared ? { key: `figure-${figure}`, scales: ["x", null], filters: { pub: (kind) => kind === "mousemove" || kind === "mouseleave" } } : {},
        },
        hooks: { draw: [(u) => this.draw(u)], setCursor: [() => this.values()], setSelect: [(u) => this.selected(u)] },
      };
    }

    legend() {
      const list = make("ul", "zoom-values");
      this.at = make("li", "", "");
      list.append(this.at);
      for (const mark of this.marks) {
        if (!mark.label || mark.kind === "rule" || (mark.kind === "band" && mark.x.length < 3)) continue; /* the key names them */
        const item = make("li", ""), swatch = make("span", `swatch ${mark.kind}`);
        swatch.style.color = `var(${mark.colour})`;
        if (mark.dashed) swatch.style.borderTopStyle = "dashed";
        mark.value = make("b", "");
        item.append(swatch, mark.label, " ", mark.value);
        list.append(item);
      }
      return list;
    }

    tools() {
      const row = make("div", "zoom-tools");
      const whole = () => this.show(this.panel.x.low, this.panel.x.high);
      for (const [sign, name, act] of [
        ["+", "Zoom in", () => this.zoom(0.5)], ["−", "Zoom out", () => this.zoom(2)], ["←", "Move left", () => this.move(-STEP)],
        ["→", "Move right", () => this.move(STEP)], ["Reset", "Show the whole signal", whole], ["Close", "Back to the drawing", () => this.close()],
      ]) {
        const button = make("button", "", sign);
        button.type = "button";
        button.title = name;
        button.setAttribute("aria-label", sign.length > 1 ? `${sign}: ${name}` : name);
        button.addEventListener("click", act);
        row.append(button);
      }
      this.range = make("span", "zoom-range");
      this.range.setAttribute("role", "status");
      row.append(this.range);
      return row;
    }

    /* Positions along x that are linear on the screen. */
    to(x) { return this.panel.x.log ? Math.log10(x) : x; }
    of(position) { return this.panel.x.log ? 10 ** position : position; }

    get whole() { return this.low <= this.panel.x.low && this.high >= this.panel.x.high; }

    show(low, high, reach, alone = false) {
      const { x, y, figure, shared } = this.panel, least = LEAST * (this.to(x.high) - this.to(x.low));
      let a = this.to(low), width = Math.min(Math.max(this.to(high) - a, least), this.to(x.high) - this.to(x.low));
      a = Math.min(Math.max(a, this.to(x.low)), this.to(x.high) - width);
      this.low = a <= this.to(x.low) ? x.low : this.of(a);
      this.high = a + width >= this.to(x.high) - 1e-3 * least ? x.high : this.of(a + width);
      const [bottom, top] = reach || (this.whole ? [y.low, y.high] : this.reach());
      this.plot.batch(() => {
        this.plot.setScale("x", { min: this.low, max: this.high });
        this.plot.setScale("y", { min: bottom, max: top });
      });
      this.tell();
      if (shared && !alone) for (const other of open) if (other !== this && other.panel.figure === figure) other.show(this.low, this.high, null, true);
    }

    tell() {
      const { x } = this.panel;
      this.range.textContent = this.whole ? "whole signal" : `${told(this.low, this.low, this.high, x.log)} to ${told(this.high, this.low, this.high, x.log)} ${x.unit}`.trim();
      this.values();
    }

    /* The window of x moved and stretched so that what was at share `was` of its width stands at share `is`. */
    transform(factor, was, is) {
      const a = this.to(this.low), width = this.to(this.high) - a, next = width * factor;
      const low = a + width * was - next * is;
      this.show(this.of(low), this.of(low + next));
    }

    zoom(factor, at = 0.5) { this.transform(factor, at, at); }
    move(share) { this.transform(1, share, 0); }

    selected(u) {
      const { left, top, width, height } = u.select;
      if (width < 2 && height < 2) return;
      const over = u.over.getBoundingClientRect();
      const reach = height < over.height - 1 ? [u.posToVal(top + height, "y"), u.posToVal(top, "y")] : null;
      if (width > over.width - 1) this.show(this.low, this.high, reach);
      else this.show(u.posToVal(left, "x"), u.posToVal(left + width, "x"), reach);
      u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    }

    wheel(event) {
      if (!event.ctrlKey) return; /* the page scrolls */
      event.preventDefault();
      const over = this.plot.over.getBoundingClientRect();
      this.zoom(Math.exp(event.deltaY * 0.01), (event.clientX - over.left) / over.width);
    }

    touches() {
      const over = this.plot.over, held = new Map();
      over.addEventListener("pointerdown", (event) => event.pointerType === "touch" && held.set(event.pointerId, event.clientX));
      for (const kind of ["pointerup", "pointercancel", "pointerleave"]) over.addEventListener(kind, (event) => held.delete(event.pointerId));
      over.addEventListener("pointermove", (event) => {
        if (!held.has(event.pointerId)) return;
        const box = over.getBoundingClientRect(), before = [...held.values()];
        held.set(event.pointerId, event.clientX);
        const after = [...held.values()], middle = (xs) => (xs.reduce((sum, x) => sum + x, 0) / xs.length - box.left) / box.width;
        const apart = (xs) => Math.max(Math.abs(xs[0] - xs[1]), 8);
        this.transform(before.length > 1 ? apart(before) / apart(after) : 1, middle(before), middle(after));
      });
    }

    key(event) {
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      const act = {
        "+": () => this.zoom(0.5), "=": () => this.zoom(0.5), "-": () => this.zoom(2), ArrowLeft: () => this.move(-STEP),
        ArrowRight: () => this.move(STEP), Escape: () => (this.whole ? this.close() : this.show(this.panel.x.low, this.panel.x.high)),
      }[event.key];
      if (!act) return;
      event.preventDefault();
      act();
    }

    close() {
      open.delete(this);
      this.sizes.disconnect();
      this.plot.destroy();
      this.root.remove();
      this.box.classList.remove("zoomed");
      this.box.querySelector("button").focus({ preventScroll: true });
    }

    /* The places of a mark's samples that the window shows, and one more on either side. */
    within(mark) {
      if (!mark.rises) return [0, mark.x.length];
      return [Math.max(from(mark.x, this.low) - 1, 0), Math.min(from(mark.x, this.high) + 2, mark.x.length)];
    }

    /* Lowest and highest number within the window, with some room. */
    reach() {
      const { y } = this.panel, shown = this.marks.filter((mark) => mark.kind === "line" || mark.kind === "points");
      let low = Infinity, high = -Infinity;
      for (const mark of shown.length ? shown : this.marks.filter((other) => other.kind === "band")) {
        const [start, end] = this.within(mark);
        for (let i = start; i < end; i++) {
          if (!(mark.x[i] >= this.low && mark.x[i] <= this.high) && !(mark.kind === "line" && mark.rises)) continue;
          for (const ys of [mark.y, mark.low, mark.high]) {
            if (ys && ys[i] < low) low = ys[i];
            if (ys && ys[i] > high) high = ys[i];
          }
        }
      }
      if (low > high) return [y.low, y.high];
      if (y.log) return [low / (high / low || 1) ** 0.05 / 1.02, high * (high / low || 1) ** 0.05 * 1.02];
      const room = 0.05 * (high - low) || 0.02 * (y.high - y.low);
      return [low - room, high + room];
    }

    values() {
      const { x, y } = this.panel, u = this.plot, left = u && u.cursor.left;
      const inside = u && left !== undefined && left !== null && left >= 0, at = inside ? u.posToVal(left, "x") : NaN;
      this.at.textContent = inside ? `${x.label.replace(/ \([^)]*\)$/, "")} ${told(at, this.low, this.high, x.log)} ${x.unit}`.trim() : "";
      for (const mark of this.marks) {
        if (!mark.value) continue;
        let place = mark.rises ? Math.min(from(mark.x, at), mark.x.length - 1) : -1;
        if (place > 0 && at - mark.x[place - 1] < mark.x[place] - at) place--;
        const missing = !inside || place < 0 || at < mark.x[0] || at > mark.x[mark.x.length - 1];
        const found = missing ? [] : mark.kind === "band" ? [mark.low[place], mark.high[place]] : [mark.y[place]];
        const texts = found.filter(Number.isFinite).map((value) => told(value, u.scales.y.min, u.scales.y.max, y.log));
        mark.value.textContent = texts.length ? `${texts.join(" to ")} ${y.unit}`.trim() : "";
      }
    }

    draw(u) {
      const c = u.ctx, dots = devicePixelRatio, { left, top, width, height } = u.bbox;
      const X = (value) => u.valToPos(value, "x", true), Y = (value) => u.valToPos(value, "y", true);
      c.save();
      c.beginPath();
      c.rect(left, top, width, height);
      c.clip();
      c.lineJoin = "round";
      this.written = [];
      for (const mark of this.marks) {
        const ink = colour(mark.colour);
        c.save();
        c.strokeStyle = c.fillStyle = ink;
        c.lineWidth = mark.width * dots;
        if (mark.kind === "line") this.line(c, mark, X, Y, dots);
        else if (mark.kind === "band") this.band(c, mark, X, Y);
        else if (mark.kind === "points") this.points(c, mark, X, Y, dots);
        else this.rule(c, mark, X, Y, dots, u.bbox);
        c.restore();
      }
      c.restore();
    }

    line(c, mark, X, Y, dots) {
      const [start, end] = this.within(mark);
      if (mark.dashed) c.setLineDash([4 * c.lineWidth, 2.2 * c.lineWidth]);
      if (mark.pale) Object.assign(c, { lineWidth: 2.8 * dots, globalAlpha: 0.6 });
      c.beginPath();
      let joined = false;
      for (let i = start; i < end; i++) {
        const there = Number.isFinite(mark.x[i]) && Number.isFinite(mark.y[i]);
        if (there) c[joined ? "lineTo" : "moveTo"](X(mark.x[i]), Y(mark.y[i]));
        joined = there;
      }
      c.stroke();
      c.setLineDash([]);
      if (!mark.series) return;
      const every = Math.max(Math.floor((end - start) / SHAPES_ON_A_LINE), 1);
      for (let i = start + (every >> 1); i < end; i += every) this.shape(c, mark, X(mark.x[i]), Y(mark.y[i]), 4.5 * dots, dots);
    }

    shape(c, mark, x, y, size, dots) {
      if (!Number.isFinite(x) || !Number.isFinite(y)) return;
      c.save();
      c.translate(x, y);
      c.scale(size / 8, size / 8);
      mark.path = mark.path || new Path2D(mark.shape);
      if (mark.hollow) Object.assign(c, { fillStyle: colour("--paper"), lineWidth: (1.1 * dots * 8) / size });
      c.fill(mark.path);
      if (mark.hollow) c.stroke(mark.path);
      c.restore();
    }

    points(c, mark, X, Y, dots) {
      const [start, end] = this.within(mark);
      const many = end - start > DOTS_FROM, size = (end - start <= 60 ? 5.5 : many ? 2.6 : 3.6) * dots;
      c.lineWidth = 1.1 * dots;
      if (mark.pale) c.globalAlpha = Math.min(Math.max(64 / (end - start), 0.15), 0.7);
      for (let i = start; i < end; i++) {
        const x = X(mark.x[i]), y = Y(mark.y[i]);
        if (mark.low) this.segment(c, x, Y(mark.low[i]), x, Y(mark.high[i]));
        if (mark.left) this.segment(c, X(mark.left[i]), y, X(mark.right[i]), y);
        if (many) c.fillRect(x - size / 2, y - size / 2, size, size);
        else this.shape(c, mark, x, y, size * (mark.pale ? 1.5 : 1.2), dots);
      }
    }

    segment(c, x0, y0, x1, y1) {
      if (![x0, y0, x1, y1].every(Number.isFinite)) return;
      c.beginPath();
      c.moveTo(x0, y0);
      c.lineTo(x1, y1);
      c.stroke();
    }

    band(c, mark, X, Y) {
      const [start, end] = this.within(mark), there = (i) => Number.isFinite(mark.low[i]) && Number.isFinite(mark.high[i]) && Number.isFinite(mark.x[i]);
      c.globalAlpha = 0.2;
      for (let i = start; i < end; i++) {
        if (!there(i)) continue;
        let last = i;
        while (last + 1 < end && there(last + 1)) last++;
        c.beginPath();
        for (let k = i; k <= last; k++) c.lineTo(X(mark.x[k]), Y(mark.high[k]));
        for (let k = last; k >= i; k--) c.lineTo(X(mark.x[k]), Y(mark.low[k]));
        c.fill();
        i = last;
      }
    }

    rule(c, mark, X, Y, dots, box) {
      const across = mark.x === undefined, value = across ? mark.y : mark.x;
      if (value === null) return;
      const at = across ? Y(value) : X(value);
      c.lineWidth = 1.2 * dots;
      c.setLineDash([5 * dots, 3 * dots]);
      if (across) this.segment(c, box.left, at, box.left + box.width, at);
      else this.segment(c, at, box.top, at, box.top + box.height);
      const room = 13 * dots; /* names of neighbours would cover each other */
      if (!mark.label || this.written.some(([other, its]) => other === across && Math.abs(its - at) < room)) return;
      this.written.push([across, at]);
      c.font = `${11 * dots}px ${getComputedStyle(document.body).fontFamily}`;
      c.textAlign = "right";
      c.textBaseline = "bottom";
      c.translate(across ? box.left + box.width - 3 * dots : at - 2 * dots, across ? at - 2 * dots : box.top + 3 * dots);
      if (!across) c.rotate(-Math.PI / 2);
      c.fillText(mark.label, 0, 0);
    }
  }

  /* A button stands in the corner of its drawing, below it where a word of the drawing is in its way. */
  function settle() {
    for (const [, , box] of buttons) box.classList.remove("below");
    const covers = buttons.map(([button, drawing]) => {
      const own = button.getBoundingClientRect();
      if (!own.width) return false;
      return [...drawing.querySelectorAll("text")].some((text) => {
        const its = text.getBoundingClientRect();
        return its.right > own.left && its.left < own.right && its.bottom > own.top && its.top < own.bottom;
      });
    });
    buttons.forEach(([, , box], at) => box.classList.toggle("below", covers[at]));
  }

  const places = panels.map((panel) => [...document.querySelectorAll(`#figure-${panel.figure} .grid`)].map((grid) => grid.children[panel.place]));
  const buttons = [];
  places.forEach((drawings, at) => {
    for (const drawing of drawings) {
      const box = make("div", "zoomable"), button = make("button", "zoom-button", "Zoom");
      button.type = "button";
      button.setAttribute("aria-label", `Zoom: ${panels[at].name}`);
      button.addEventListener("click", () => new View(box, panels[at]));
      drawing.replaceWith(box);
      box.append(drawing, button);
      buttons.push([button, drawing, box]);
    }
  });
  settle();
  addEventListener("resize", settle);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => open.forEach((view) => view.plot.redraw(false, true)));
})();
