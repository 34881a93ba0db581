// One channel's plot: lines over an abscissa, the residual below, a cursor.

const MARGIN = { left: 58, right: 8, top: 8, bottom: 34, gap: 12 };
const MAIN_HEIGHT = 150;
const REST_HEIGHT = 60;
const DECADES = 4;
const LABELS = {
  measured: 'measured',
  simulated: 'simulated',
  extended: 'extended twin',
  residual: 'measured − simulated',
  'residual-after': 'measured − extended twin',
};

function node(name, attributes, parent, text) {
  const made = document.createElementNS('http://www.w3.org/2000/svg', name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (text !== undefined) made.textContent = text;
  if (parent) parent.append(made);
  return made;
}

// A path through the samples in view; through the extremes of a pixel where it holds many. It
// breaks at gaps, and where the abscissa comes back.
function outline(x, y, toX, toY, range, whole) {
  const parts = [];
  let column = null;
  let pen = false;
  let last = NaN;
  const flush = () => {
    if (!column) return;
    const order = column.lowAt < column.highAt ? [column.low, column.high] : [column.high, column.low];
    for (const value of new Set([column.first, ...order, column.last])) {
      parts.push(`${pen ? 'L' : 'M'}${column.at} ${toY(value).toFixed(1)}`);
      pen = true;
    }
    column = null;
  };
  const span = range[1] - range[0];
  for (let i = 0; i < x.length; i += 1) {
    const isFar = Number.isFinite(last) && Math.abs(x[i] - last) > 0.5 * whole;
    last = x[i];
    const isOut = x[i] < range[0] - 0.02 * span || x[i] > range[1] + 0.02 * span;
    if (Number.isNaN(y[i]) || isOut || isFar) {
      flush();
      pen = false;
      if (Number.isNaN(y[i]) || isOut) continue;
    }
    const at = toX(x[i]).toFixed(0);
    if (column && column.at !== at) flush();
    if (!column) column = { at, first: y[i], low: y[i], high: y[i], lowAt: i, highAt: i };
    if (y[i] < column.low) Object.assign(column, { low: y[i], lowAt: i });
    if (y[i] > column.high) Object.assign(column, { high: y[i], highAt: i });
    column.last = y[i];
  }
  flush();
  return parts.join('');
}

class Panel {
  constructor(stack, figure, data) {
    this.stack = stack;
    this.data = data;
    this.place = figure.querySelector('.plot');
    this.readout = figure.querySelector('.readout');
    this.y = Object.fromEntries(Object.entries(data.series).map(([k, v]) => [k, unpack(v)]));
    this.rest = {};
    if (data.residual) {
      this.rest.residual = minus(this.y.measured, this.y.simulated);
      if (this.y.extended) this.rest['residual-after'] = minus(this.y.measured, this.y.extended);
    }
    if (data.log) this.logarithms();
  }

  logarithms() {
    const floor = extent([this.y.measured])[1] * 10 ** -DECADES || 1e-12;
    for (const [name, values] of Object.entries(this.y)) {
      this.y[name] = values.map((value) => Math.log10(Math.max(value, floor)));
    }
  }

  get x() {
    return this.stack.grid(this.data.grid);
  }

  draw(width, range) {
    const shown = (lines) => Object.fromEntries(
      Object.entries(lines).filter(([name]) => !this.stack.hidden.has(name)));
    const svg = node('svg', { class: 'live', width, role: 'img' });
    svg.setAttribute('aria-label', `${this.data.channel}: measured and simulated`);
    this.toX = (value) => MARGIN.left
      + (width - MARGIN.left - MARGIN.right) * (value - range[0]) / (range[1] - range[0]);
    this.width = width;
    this.range = range;
    let bottom = MARGIN.top + MAIN_HEIGHT;
    this.field(svg, shown(this.y), MARGIN.top, MAIN_HEIGHT, 5, this.data.log);
    if (this.data.residual) {
      this.field(svg, shown(this.rest), bottom + MARGIN.gap, REST_HEIGHT, 3, false);
      bottom += MARGIN.gap + REST_HEIGHT;
    }
    this.bottom = bottom;
    this.abscissa(svg, bottom);
    svg.setAttribute('height', bottom + MARGIN.bottom);
    svg.setAttribute('viewBox', `0 0 ${width} ${bottom + MARGIN.bottom}`);
    this.brush = node('rect', { class: 'brush', y: MARGIN.top, width: 0, height: bottom - MARGIN.top }, svg);
    this.cursor = node('path', { class: 'cursor', d: '' }, svg);
    this.place.replaceChildren(svg);
    this.svg = svg;
  }

  // Grid, labels and lines of one ordinate.
  field(svg, lines, top, height, count, isLog) {
    const [low, high] = extent(Object.values(lines), this.x, this.range);
    const margin = 0.04 * (high - low) || 1;
    const bounds = [isLog ? low : low - margin, high + margin];
    const toY = (value) => top + height * (bounds[1] - value) / (bounds[1] - bounds[0]);
    const grid = node('g', { class: 'grid' }, svg);
    for (const value of ticks(...this.range, this.width / 80).marks) {
      node('path', { d: `M${this.toX(value).toFixed(1)} ${top}v${height}` }, grid);
    }
    const { marks, step } = ticks(...bounds, count);
    for (const value of marks) {
      if (isLog && !Number.isInteger(value) && marks.some(Number.isInteger)) continue;
      const at = toY(value).toFixed(1);
      node('path', { d: `M${MARGIN.left} ${at}H${this.width - MARGIN.right}` }, grid);
      const label = isLog ? decadeLabel(value) : tickLabel(value, step);
      node('text', { class: 'y', x: MARGIN.left - 6, y: Number(at) + 3.5 }, grid, label);
    }
    const clip = `clip-${this.stack.key}-${this.data.channel}-${top}`.replace(/[^\w-]/g, '-');
    const clipPath = node('clipPath', { id: clip }, svg);
    node('rect', { x: MARGIN.left, y: top, width: this.width - MARGIN.left - MARGIN.right, height }, clipPath);
    const whole = this.stack.full[1] - this.stack.full[0];
    const group = node('g', { 'clip-path': `url(#${clip})` }, svg);
    for (const [name, values] of Object.entries(lines)) {
      node('path', { class: name, d: outline(this.x, values, this.toX, toY, this.range, whole) }, group);
    }
  }

  abscissa(svg, bottom) {
    const group = node('g', { class: 'ticks' }, svg);
    const { marks, step } = ticks(...this.range, this.width / 80);
    for (const value of marks) {
      node('text', { class: 'x', x: this.toX(value).toFixed(1), y: bottom + 14 }, group, tickLabel(value, step));
    }
    const axis = this.stack.axis;
    const middle = (MARGIN.left + this.width - MARGIN.right) / 2;
    node('text', { class: 'x title', x: middle, y: bottom + 29 }, group, `${axis.label} (${axis.unit})`);
  }

  fromEvent(event) {
    const box = this.svg.getBoundingClientRect();
    const share = ((event.clientX - box.left) / box.width * this.width - MARGIN.left)
      / (this.width - MARGIN.left - MARGIN.right);
    return this.range[0] + Math.min(Math.max(share, 0), 1) * (this.range[1] - this.range[0]);
  }

  point(at) {
    if (at === null) {
      this.cursor.setAttribute('d', '');
      this.readout.textContent = '';
      return;
    }
    const i = nearest(this.x, at);
    this.cursor.setAttribute('d', `M${this.toX(this.x[i]).toFixed(1)} ${MARGIN.top}V${this.bottom}`);
    const value = (y) => valueLabel(this.data.log ? 10 ** y : y);
    const parts = [`${this.stack.axis.label} ${valueLabel(this.x[i])} ${this.stack.axis.unit}`];
    for (const name of ['measured', 'simulated', 'extended']) {
      if (this.y[name]) parts.push(`${LABELS[name]} ${value(this.y[name][i])}`);
    }
    for (const [name, values] of Object.entries(this.rest)) {
      parts.push(`${LABELS[name]} ${valueLabel(values[i])}`);
    }
    this.readout.textContent = `${parts.join(' · ')} ${this.data.unit}`;
  }

  select(from, to) {
    const ends = [this.toX(from), this.toX(to)].sort((a, b) => a - b);
    this.brush.setAttribute('x', ends[0]);
    this.brush.setAttribute('width', from === to ? 0 : ends[1] - ends[0]);
  }
}
