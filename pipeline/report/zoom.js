/* Long signals: a button at the drawing sets uPlot in its place. Drag, pinch, buttons and keys zoom.
   The drawing stays for print, and for browsers that run no scripts. */
(() => {
  "use strict";
  const source = document.getElementById("zoom");
  if (!source) return;
  const { arrays, panels } = JSON.parse(source.textContent);
  const { unpack, from, fixed, decimals, told, power } = zoomNumbers;
  const LEAST = 1e-5, STEP = 0.2, NUDGE = 0.01; /* shares of the width: the narrowest window, how far window and cursor move */
  const open = new Set();

  const make = (name, className, textContent = "") => Object.assign(document.createElement(name), { className, textContent });
  const unpacked = [];
  const numbers = (place) => (unpacked[place] = unpacked[place] || unpack(arrays[place]));

  class View {
    constructor(box, panel) {
      this.box = box;
      this.panel = panel;
      this.marks = panel.marks.map((mark) => {
        const own = { ...mark };
        if (mark.kind === "rule") return own;
        for (const name of ["x", "y", "low", "high", "left", "right"]) if (name in mark) own[name] = numbers(mark[name]);
        own.rises = own.x.every((x, i) => i === 0 || x >= own.x[i - 1]);
        own.within = () => this.within(own);
        return own;
      });
      const drawing = box.firstElementChild.getBoundingClientRect();
      this.root = make("div", "zoom-view");
      this.root.tabIndex = 0;
      this.root.setAttribute("role", "application");
      const keys = "Arrow keys move the cursor, with Shift the window; plus and minus zoom, Escape goes back.";
      this.root.setAttribute("aria-label", `${panel.name}, enlarged. ${keys}`);
      if (panel.title) this.root.append(make("p", "zoom-title", panel.title));
      this.stage = make("div", "zoom-stage");
      this.said = make("p", "zoom-said");
      this.said.setAttribute("aria-live", "polite");
      this.root.append(this.stage, this.tools(), this.legend(), this.said);
      box.append(this.root);
      box.classList.add("zoomed");
      this.low = panel.x.low;
      this.high = panel.x.high;
      this.plot = new uPlot(this.options(drawing), [[panel.x.low, panel.x.high], [null, null]], this.stage);
      this.plot.over.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
      this.touches();
      this.root.addEventListener("keydown", (event) => this.key(event));
      this.sizes = new ResizeObserver(() => {
        if (box.clientWidth) this.plot.setSize({ width: box.clientWidth, height: this.plot.height });
      });
      this.sizes.observe(box);
      this.tell();
      open.add(this);
      this.root.focus({ preventScroll: true });
    }

    options(drawing) {
      const { x, y, figure, shared } = this.panel, font = `13px ${getComputedStyle(document.body).fontFamily}`;
      const axis = (own, more) => ({
        label: own.label, font, labelFont: font, labelSize: 20, labelGap: 0, gap: 5, stroke: () => zoomColour("--ink"),
        border: { show: true, stroke: () => zoomColour("--quiet"), width: 1 },
        grid: { stroke: () => zoomColour("--grid"), width: 1 }, ticks: { show: false },
        values: (u, places, at, space, step) =>
          places.map((place) => (place === null ? "" : own.log ? power(place, 3) : fixed(place, decimals(step)))),
        ...more,
      });
      const scale = ({ low, high, log }) => ({
        time: false, auto: false, distr: log ? 3 : 1, min: low, max: high, range: (u, bottom, top) => [bottom, top],
      });
      const moves = (kind) => kind === "mousemove" || kind === "mouseleave";
      const widest = (u, texts, at, cycle) => {
        if (cycle > 1) return u.axes[at]._size;
        u.ctx.font = u.axes[at].font[0];
        return 12 + Math.max(...(texts || []).map((text) => u.ctx.measureText(text).width / devicePixelRatio), 16);
      };
      return {
        width: this.box.clientWidth, height: Math.max(drawing.height, 240), padding: [10, 24, 0, 0],
        scales: { x: scale(x), y: scale(y) },
        axes: [axis(x, { size: 26 }), axis(y, { size: widest })],
        series: [{}, { scale: "y", paths: () => null, points: { show: false } }],
        legend: { show: false },
        cursor: {
          points: { show: false }, y: false, drag: { x: true, y: true, uni: 24, setScale: false },
          bind: { dblclick: () => () => this.show(x.low, x.high) },
          sync: shared ? { key: `figure-${figure}`, scales: ["x", null], filters: { pub: moves } } : {},
        },
        hooks: {
          draw: [(u) => new ZoomMarks(u).draw(this.marks)],
          setCursor: [() => this.values()],
          setSelect: [(u) => this.selected(u)],
        },
      };
    }

    legend() {
      const list = make("ul", "zoom-values");
      this.at = make("li", "", "");
      list.append(this.at);
      for (const mark of this.marks) {
        const stretch = mark.kind === "band" && mark.x.length < 3; /* of time; the key names it */
        if (!mark.label || mark.kind === "rule" || stretch) continue;
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
        ["+", "Zoom in", () => this.zoom(0.5)],
        ["−", "Zoom out", () => this.zoom(2)],
        ["←", "Move left", () => this.move(-STEP)],
        ["→", "Move right", () => this.move(STEP)],
        ["Reset", "Show the whole signal", whole],
        ["Close", "Back to the drawing", () => this.close()],
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
      if (!shared || alone) return;
      for (const other of open) if (other !== this && other.panel.figure === figure) other.show(this.low, this.high, null, true);
    }

    tell() {
      const { x } = this.panel, [low, high] = [this.low, this.high].map((limit) => told(limit, this.low, this.high, x.log));
      this.range.textContent = this.whole ? "whole signal" : `${low} to ${high} ${x.unit}`.trim();
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

    /* Where the cursor stands, as a share of the window's width; the middle where there is none. */
    get share() { return this.plot.cursor.left >= 0 ? this.plot.cursor.left / this.plot.over.clientWidth : 0.5; }

    /* The cursor goes one way, at the edge the window with it; its values are told. */
    nudge(way) {
      const width = this.plot.over.clientWidth, place = this.share + way * NUDGE, beyond = place < 0 || place > 1;
      const x = this.plot.posToVal(place * width, "x");
      if (beyond) this.move(way * STEP);
      const left = beyond ? this.plot.valToPos(x, "x") : place * width;
      this.plot.setCursor({ left: Math.min(Math.max(left, 0), width), top: 0 }, true, true);
      const told = this.marks.filter(({ value }) => value && value.textContent).map(({ label, value }) => `${label} ${value.textContent}`);
      this.said.textContent = [this.at.textContent, ...told].join("; ");
    }

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
      over.addEventListener("pointerdown", (event) => {
        if (event.pointerType === "touch") held.set(event.pointerId, event.clientX);
      });
      for (const kind of ["pointerup", "pointercancel", "pointerleave"])
        over.addEventListener(kind, (event) => held.delete(event.pointerId));
      over.addEventListener("pointermove", (event) => {
        if (!held.has(event.pointerId)) return;
        const box = over.getBoundingClientRect(), before = [...held.values()];
        held.set(event.pointerId, event.clientX);
        const after = [...held.values()];
        const middle = (xs) => (xs.reduce((sum, x) => sum + x, 0) / xs.length - box.left) / box.width;
        const apart = (xs) => Math.max(Math.abs(xs[0] - xs[1]), 8);
        this.transform(before.length > 1 ? apart(before) / apart(after) : 1, middle(before), middle(after));
      });
    }

    key(event) {
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      const act = {
        "+": () => this.zoom(0.5, this.share),
        "=": () => this.zoom(0.5, this.share),
        "-": () => this.zoom(2, this.share),
        ArrowLeft: () => (event.shiftKey ? this.move(-STEP) : this.nudge(-1)),
        ArrowRight: () => (event.shiftKey ? this.move(STEP) : this.nudge(1)),
        Escape: () => (this.whole ? this.close() : this.show(this.panel.x.low, this.panel.x.high)),
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
      this.at.textContent = inside ? `${x.name} ${told(at, this.low, this.high, x.log)} ${x.unit}`.trim() : "";
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

  const grids = ({ figure }) => [...document.querySelectorAll(`#figure-${figure} .grid`)];
  const places = panels.map((panel) => grids(panel).map((grid) => grid.children[panel.place]));
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
  const recoloured = () => open.forEach((view) => view.plot.redraw(false, true));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", recoloured);
})();
