/* Numbers of zoomed panels: unpacked as packed.py packed them, written as scale.py writes them. */
const zoomNumbers = (() => {
  "use strict";
  const MISSING = 0xffffff;
  const SIGNS = { "-": "⁻", 0: "⁰", 1: "¹", 2: "²", 3: "³", 4: "⁴", 5: "⁵", 6: "⁶", 7: "⁷", 8: "⁸", 9: "⁹" };

  function unpack({ n, first, step, codes, log }) {
    const found = new Float64Array(n), raw = codes === undefined ? null : atob(codes);
    for (let i = 0; i < n; i++) {
      let code = i;
      if (raw !== null) code = (raw.charCodeAt(3 * i) << 16) | (raw.charCodeAt(3 * i + 1) << 8) | raw.charCodeAt(3 * i + 2);
      found[i] = raw !== null && code === MISSING ? NaN : first + step * code;
    }
    return log ? found.map((value) => 10 ** value) : found;
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

  function fixed(value, places) {
    const text = value.toFixed(places);
    return Number(text) === 0 ? (0).toFixed(places) : text.replace("-", "−");
  }

  /* So many places behind the point that multiples of `step` differ, and are told whole where it is round. */
  function decimals(step) {
    const least = Math.min(Math.max(Math.ceil(-Math.log10(step) - 1e-9), 0), 12);
    return Math.abs(Number(step.toFixed(least)) - step) > 1e-6 * step ? least + 1 : least;
  }

  /* A number with the digits that the range shown can tell apart. */
  function told(value, low, high, log) {
    if (log) return power(value, 4);
    return fixed(value, decimals(10 ** Math.floor(Math.log10((high - low) / 200))));
  }

  function power(value, digits) {
    const exponent = Math.floor(Math.log10(Math.abs(value)) + 1e-9);
    if (exponent >= -3 && exponent < 4) return String(Number(value.toPrecision(digits))).replace("-", "−");
    const ten = "10" + [...String(exponent)].map((sign) => SIGNS[sign]).join("");
    const factor = Number((value / 10 ** exponent).toPrecision(digits));
    return factor === 1 ? ten : `${factor}×${ten}`;
  }

  return { unpack, from, fixed, decimals, told, power };
})();
