/* Draws the marks of a zoomed panel on uPlot's canvas, with the looks that marks.py gives them in the drawing. */
const zoomColour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

const ZoomMarks = (() => {
  "use strict";
  const SHAPES_ON_A_LINE = 6, FEW = 60, DOTS_FROM = 600;

  return class {
    /* `u` is the plot; each mark tells by `within()` which of its samples the window shows. */
    constructor(u) {
      this.c = u.ctx;
      this.dots = devicePixelRatio;
      this.box = u.bbox;
      this.X = (value) => u.valToPos(value, "x", true);
      this.Y = (value) => u.valToPos(value, "y", true);
      this.written = [];
    }

    draw(marks) {
      const { c, box, dots } = this;
      c.save();
      c.beginPath();
      c.rect(box.left, box.top, box.width, box.height);
      c.clip();
      c.lineJoin = "round";
      for (const mark of marks) {
        c.save();
        c.strokeStyle = c.fillStyle = zoomColour(mark.colour);
        c.lineWidth = mark.width * dots;
        this[mark.kind](mark);
        c.restore();
      }
      c.restore();
    }

    line(mark) {
      const { c, X, Y, dots } = this;
      const [start, end] = mark.within();
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
      for (let i = start + (every >> 1); i < end; i += every) this.shape(mark, X(mark.x[i]), Y(mark.y[i]), 4.5 * dots);
    }

    shape(mark, x, y, size) {
      const { c, dots } = this;
      if (!Number.isFinite(x) || !Number.isFinite(y)) return;
      c.save();
      c.translate(x, y);
      c.scale(size / 8, size / 8);
      mark.path = mark.path || new Path2D(mark.shape);
      if (mark.hollow) Object.assign(c, { fillStyle: zoomColour("--paper"), lineWidth: (1.1 * dots * 8) / size });
      c.fill(mark.path);
      if (mark.hollow) c.stroke(mark.path);
      c.restore();
    }

    points(mark) {
      const { c, X, Y, dots } = this;
      const [start, end] = mark.within();
      const many = end - start > DOTS_FROM, size = (end - start <= FEW ? 5.5 : many ? 2.6 : 3.6) * dots;
      c.lineWidth = 1.1 * dots;
      if (mark.pale) c.globalAlpha = Math.min(Math.max(64 / (end - start), 0.15), 0.7);
      for (let i = start; i < end; i++) {
        const x = X(mark.x[i]), y = Y(mark.y[i]);
        if (mark.low) this.segment(x, Y(mark.low[i]), x, Y(mark.high[i]));
        if (mark.left) this.segment(X(mark.left[i]), y, X(mark.right[i]), y);
        if (many) c.fillRect(x - size / 2, y - size / 2, size, size);
        else this.shape(mark, x, y, size * (mark.pale ? 1.5 : 1.2));
      }
    }

    segment(x0, y0, x1, y1) {
      const { c } = this;
      if (![x0, y0, x1, y1].every(Number.isFinite)) return;
      c.beginPath();
      c.moveTo(x0, y0);
      c.lineTo(x1, y1);
      c.stroke();
    }

    band(mark) {
      const { c, X, Y } = this;
      const [start, end] = mark.within();
      const there = (i) => [mark.x[i], mark.low[i], mark.high[i]].every(Number.isFinite);
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

    rule(mark) {
      const { c, X, Y, dots, box } = this;
      const across = mark.x === undefined, value = across ? mark.y : mark.x;
      if (value === null) return;
      const at = across ? Y(value) : X(value);
      c.lineWidth = 1.2 * dots;
      c.setLineDash([5 * dots, 3 * dots]);
      if (across) this.segment(box.left, at, box.left + box.width, at);
      else this.segment(at, box.top, at, box.top + box.height);
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
  };
})();
