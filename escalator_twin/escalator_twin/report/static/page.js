// Stacks of panels over one abscissa, zoomed together; what stays still on paper is in the page.

const PAPER_WIDTH = 700;
const LEAST_SAMPLES = 8;

class Stack {
  constructor(root) {
    this.root = root;
    this.key = root.id;
    const data = JSON.parse(root.querySelector('script').textContent);
    this.axes = data.axes;
    this.grids = data.grids.map((grid) => Object.fromEntries(
      Object.entries(grid).map(([name, packed]) => [name, unpack(packed)])));
    this.hidden = new Set();
    this.choose(data.axis);
    const figures = root.querySelectorAll('figure');
    this.panels = data.panels.map((panel, i) => new Panel(this, figures[i], panel));
    root.querySelector('.tools').hidden = false;
    this.listen();
    this.panels.forEach((panel, i) => this.follow(panel, figures[i].querySelector('.plot')));
    this.draw();
  }

  choose(name) {
    this.axis = this.axes.find((axis) => axis.name === name);
    this.columns = this.grids.map((grid) => grid[name]);
    this.full = extent(this.columns);
    this.range = this.full;
  }

  grid(i) {
    return this.columns[i];
  }

  get width() {
    const place = this.panels[0].place;
    return Math.max(place.clientWidth || place.parentElement.clientWidth, 280);
  }

  draw(width = this.width) {
    this.drawn = width;
    for (const panel of this.panels) panel.draw(width, this.range);
    this.clear();
    this.root.dataset.drawn = String(this.panels.length);
    const isWhole = this.range[0] === this.full[0] && this.range[1] === this.full[1];
    this.root.querySelector('[data-do=reset]').disabled = isWhole;
  }

  zoom(low, high) {
    const least = LEAST_SAMPLES * (this.full[1] - this.full[0]) / this.columns[0].length;
    if (!(high - low >= least)) return;
    const span = Math.min(high - low, this.full[1] - this.full[0]);
    const start = Math.min(Math.max(low, this.full[0]), this.full[1] - span);
    this.range = span < this.full[1] - this.full[0] ? [start, start + span] : this.full;
    this.draw();
  }

  // Move by a share of the view, and widen it by a factor about its middle.
  move(share, factor = 1) {
    const span = (this.range[1] - this.range[0]) * factor;
    const middle = (this.range[0] + this.range[1]) / 2 + share * span;
    this.zoom(middle - span / 2, middle + span / 2);
  }

  listen() {
    const actions = {
      in: () => this.move(0, 0.5),
      out: () => this.move(0, 2),
      left: () => this.move(-0.25),
      right: () => this.move(0.25),
      reset: () => this.zoom(...this.full),
    };
    const keys = { '+': 'in', '=': 'in', '-': 'out', ArrowLeft: 'left', ArrowRight: 'right', Escape: 'reset' };
    this.root.querySelectorAll('[data-do]').forEach((button) => {
      button.addEventListener('click', actions[button.dataset.do]);
    });
    this.root.querySelectorAll('[data-axis]').forEach((input) => {
      input.addEventListener('change', () => {
        this.choose(input.value);
        this.draw();
      });
    });
    this.root.querySelectorAll('[data-series]').forEach((input) => {
      input.addEventListener('change', () => {
        this.hidden[input.checked ? 'delete' : 'add'](input.value);
        this.draw();
      });
    });
    this.root.addEventListener('keydown', (event) => {
      if (!event.target.classList.contains('plot') || !keys[event.key]) return;
      event.preventDefault();
      actions[keys[event.key]]();
    });
  }

  // The cursor, and a drag that chooses the range of all panels.
  follow(panel, place) {
    let from = null;
    place.addEventListener('pointerdown', (event) => {
      if (event.button !== 0) return;
      from = panel.fromEvent(event);
      place.setPointerCapture(event.pointerId);
    });
    place.addEventListener('pointermove', (event) => {
      const at = panel.fromEvent(event);
      for (const other of this.panels) {
        other.point(at);
        other.select(from ?? at, at);
      }
    });
    place.addEventListener('pointerup', (event) => {
      const ends = [from ?? 0, panel.fromEvent(event)].sort((a, b) => a - b);
      const isDrag = from !== null && ends[1] - ends[0] > 0.01 * (this.range[1] - this.range[0]);
      from = null;
      this.clear();
      if (isDrag) this.zoom(...ends);
    });
    place.addEventListener('pointercancel', () => { from = null; this.clear(); });
    place.addEventListener('pointerleave', () => { if (from === null) this.clear(); });
    place.addEventListener('dblclick', () => this.zoom(...this.full));
  }

  clear() {
    for (const panel of this.panels) {
      panel.point(null);
      panel.select(0, 0);
    }
  }
}

const stacks = new Map();

function isVisible(root) {
  return !root.closest('details:not([open])');
}

function drawVisible() {
  for (const root of document.querySelectorAll('.stack')) {
    if (!isVisible(root)) continue;
    if (!stacks.has(root)) stacks.set(root, new Stack(root));
    const stack = stacks.get(root);
    if (stack.drawn !== stack.width) stack.draw();
  }
}

function each(action) {
  for (const [root, stack] of stacks) if (isVisible(root)) action(stack);
}

document.documentElement.classList.add('live');
document.querySelectorAll('details').forEach((part) => part.addEventListener('toggle', drawVisible));
document.querySelectorAll('[data-open]').forEach((button) => {
  button.hidden = false;
  button.addEventListener('click', () => {
    const open = button.dataset.open === 'all';
    document.querySelectorAll('details.recording').forEach((part) => { part.open = open; });
  });
});
// A link into a closed part opens it.
function openTarget() {
  const target = location.hash && document.getElementById(decodeURIComponent(location.hash.slice(1)));
  const part = target && target.closest('details');
  if (part) part.open = true;
}
window.addEventListener('hashchange', openTarget);
window.addEventListener('resize', drawVisible);
window.addEventListener('beforeprint', () => each((stack) => stack.draw(PAPER_WIDTH)));
window.addEventListener('afterprint', drawVisible);
openTarget();
drawVisible();
