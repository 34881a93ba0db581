// Packed series (series.py): value[i] = a + b i + s q[i], q being int16 in base64.
'use strict';

const GAP = -32768;

function unpack(packed) {
  const values = new Float64Array(packed.n);
  for (let i = 0; i < packed.n; i += 1) values[i] = packed.a + packed.b * i;
  if (packed.q === undefined) return values;
  const text = atob(packed.q);
  for (let i = 0; i < packed.n; i += 1) {
    let level = text.charCodeAt(2 * i) | (text.charCodeAt(2 * i + 1) << 8);
    if (level >= 32768) level -= 65536;
    values[i] = level === GAP ? NaN : values[i] + packed.s * level;
  }
  return values;
}

function minus(first, second) {
  return first.map((value, i) => value - second[i]);
}

function extent(arrays, x, range) {
  let low = Infinity;
  let high = -Infinity;
  for (const values of arrays) {
    for (let i = 0; i < values.length; i += 1) {
      if (x && (x[i] < range[0] || x[i] > range[1])) continue;
      if (values[i] < low) low = values[i];
      if (values[i] > high) high = values[i];
    }
  }
  return low <= high ? [low, high] : [0, 1];
}

function nearest(x, wanted) {
  let best = 0;
  for (let i = 1; i < x.length; i += 1) {
    if (Math.abs(x[i] - wanted) < Math.abs(x[best] - wanted)) best = i;
  }
  return best;
}

function niceStep(raw) {
  if (!(raw > 0)) return 1;
  const power = 10 ** Math.floor(Math.log10(raw));
  return power * [1, 2, 5, 10].find((factor) => factor * power >= raw * (1 - 1e-9));
}

function ticks(low, high, count) {
  let step = niceStep((high - low) / Math.max(count, 1));
  if (Math.floor(high / step) - Math.ceil(low / step) < 1) step = niceStep(step / 4);
  const marks = [];
  for (let i = Math.ceil(low / step - 1e-9); i <= Math.floor(high / step + 1e-9); i += 1) {
    marks.push(i * step);
  }
  return { marks, step };
}

function tickLabel(value, step) {
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const shown = value.toFixed(Math.min(digits, 12));
  return (Number(shown) === 0 ? shown.replace('-', '') : shown).replace('-', '−');
}

function decadeLabel(value) {
  const raised = String(Math.round(value)).replace(/./g, (c) => '⁻⁰¹²³⁴⁵⁶⁷⁸⁹'['-0123456789'.indexOf(c)]);
  return `10${raised}`;
}

function valueLabel(value) {
  if (!Number.isFinite(value)) return '–';
  const size = Math.abs(value);
  const text = size !== 0 && size < 1e-3 ? value.toExponential(2) : value.toPrecision(4);
  return text.replace('-', '−');
}
