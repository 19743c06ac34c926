/**
 * The mimic: the winder in SVG, to scale, drawn from the machine's numbers and the live values.
 *
 * Not here: labels of the page around it, and commands.
 *
 * The scene is in metres, y upwards from the floor; it is put on the screen in one place, `Scene.px`. The web is a
 * belt around circles: each roll is a circle with the sense in which it turns, and the web runs along the common
 * tangents. So the path stays right however the rolls grow.
 *
 * A roll shows its speed by marks that turn with it. What moves far between two pictures would seem to stand or turn
 * back, so a mark is smeared over the angle that it moves in one picture, as the eye would see it.
 */
import { html, useEffect, useRef, untracked } from './vendor/ui.js';
import { value, bit, counts, figure, state } from './live.js';

const SVG = 'http://www.w3.org/2000/svg';
/** Time of a picture, s. */
const PICTURE_S = 1 / 60;
/** Tension shown as usual: within this share of its reference. */
const USUAL = 0.15;
/** Sag of a slack web, of its span. */
const SAG = 0.16;

/** The machine's numbers that are drawn, m. */
export function geometry(parameters) {
  const of = (name, otherwise) => parameters.get(name) ?? otherwise;
  const idle = [];
  for (let i = 0; parameters.has(`idle[${i}].radius_m`); i++)
    idle.push({ r: of(`idle[${i}].radius_m`), span: of(`idle[${i}].span_m`) });
  // until the numbers have come
  if (!idle.length) idle.push({ r: 0.2, span: 6 }, { r: 0.15, span: 3 });
  return {
    full: of('parent_roll.full_radius_m', 1.5),
    spool: of('parent_roll.spool_radius_m', 0.4),
    idle,
    cells: of('load_cells.roll', 0),
    last: of('last_span_m', 2.5),
    rd: of('rear_drum.radius_m', 0.425),
    fd: of('front_drum.radius_m', 0.425),
    rr: of('rider_roll.radius_m', 0.15),
    core: of('shipping_roll.core_radius_m', 0.05),
    shipping: of('shipping_roll.full_radius_m', 0.625),
    gap: of('nips.drum_gap_m', 0.012),
  };
}

function node(parent, name, attributes = {}) {
  const made = document.createElementNS(SVG, name);
  for (const [key, v] of Object.entries(attributes)) made.setAttribute(key, v);
  parent.append(made);
  return made;
}
const set = (element, attributes) => {
  for (const key in attributes) element.setAttribute(key, attributes[key]);
};
const round = (v) => Math.round(v * 100) / 100;

/** A circle that turns. */
class Roll {
  constructor(parent, kind, marks) {
    this.group = node(parent, 'g', { class: `roll ${kind}` });
    this.body = node(this.group, 'circle', { class: 'body' });
    this.marks = marks;
    this.mark = node(this.group, 'circle', { class: 'turn' });
    this.angle = 0;
  }
  /** Place and size in px, speed in rad/s, clockwise positive. */
  draw(x, y, r, at, omega, dt) {
    this.angle = (this.angle + omega * dt) % (2 * Math.PI);
    set(this.body, { cx: round(x), cy: round(y), r: round(r) });
    const ring = r * at;
    const each = (2 * Math.PI) / this.marks;
    const mark = Math.min(each, 0.34 + Math.abs(omega) * PICTURE_S);
    set(this.mark, {
      cx: round(x),
      cy: round(y),
      r: round(ring),
      'stroke-dasharray': `${round(ring * mark)} ${round(ring * (each - mark))}`,
      'stroke-width': round(Math.max(1.6, r * 0.07)),
      transform: `rotate(${round((this.angle * 180) / Math.PI)} ${round(x)} ${round(y)})`,
    });
  }
}

/**
 * Common tangent of two circles `{ x, y, r, s }`, y downwards, s = 1 clockwise, −1 counter-clockwise.
 *
 * With the direction d = (cos θ, sin θ) of travel, the web touches a circle at c + s·r·n, n = (sin θ, −cos θ). Both
 * points lie on one line along d when D·n = −(r₂·s₂ − r₁·s₁), D from centre to centre.
 */
function tangent(a, b) {
  const [dx, dy] = [b.x - a.x, b.y - a.y];
  const k = b.r * b.s - a.r * a.s;
  const theta = Math.atan2(dy, dx) + Math.asin(Math.max(-1, Math.min(1, -k / Math.hypot(dx, dy))));
  const n = [Math.sin(theta), -Math.cos(theta)];
  return [
    [a.x + a.s * a.r * n[0], a.y + a.s * a.r * n[1]],
    [b.x + b.s * b.r * n[0], b.y + b.s * b.r * n[1]],
  ];
}

const point = ([x, y]) => `${round(x)} ${round(y)}`;

/** The arc on a circle from a point to another, in its sense of turning. */
function arc(circle, from, to) {
  const angle = ([x, y]) => Math.atan2(y - circle.y, x - circle.x);
  const swept = (circle.s * (angle(to) - angle(from)) + 4 * Math.PI) % (2 * Math.PI);
  return `A${round(circle.r)} ${round(circle.r)} 0 ${swept > Math.PI ? 1 : 0} ${circle.s > 0 ? 1 : 0} ${point(to)}`;
}

/** The picture in an element. */
class Scene {
  constructor(svg) {
    this.svg = svg;
    const frame = node(svg, 'g', { class: 'frame' });
    this.floor = node(frame, 'path', { class: 'floor' });
    this.stands = node(frame, 'path', { class: 'stand' });
    this.beam = node(frame, 'path', { class: 'beam' });
    this.ghost = node(svg, 'path', { class: 'ghost' });
    this.parent = new Roll(svg, 'paper', 3);
    this.rings = node(this.parent.group, 'g', { class: 'rings' });
    this.spool = new Roll(svg, 'spool', 3);
    this.idle = [];
    this.idles = node(svg, 'g');
    this.rd = new Roll(svg, 'steel', 4);
    this.fd = new Roll(svg, 'steel', 4);
    this.wu = new Roll(svg, 'paper', 3);
    this.core = new Roll(svg, 'spool', 2);
    this.rr = new Roll(svg, 'steel', 3);
    this.web = node(svg, 'g', { class: 'web' });
    this.spans = [];
    this.flow = node(svg, 'path', { class: 'flow' });
    this.knives = node(svg, 'g', { class: 'knives' });
    this.upper = node(this.knives, 'circle');
    this.lower = node(this.knives, 'circle');
    this.cell = node(svg, 'path', { class: 'cell' });
    this.torn = node(svg, 'path', { class: 'torn' });
    this.brakes = ['uw', 'rd', 'fd'].map((name) => [name, node(svg, 'path', { class: 'brake' })]);
    this.texts = new Map();
    this.shift = 0;
    this.size = [0, 0];
  }

  text(key, x, y, content, anchor = 'middle', kind = '') {
    let one = this.texts.get(key);
    if (!one) this.texts.set(key, (one = node(this.svg, 'text')));
    set(one, { x: round(x), y: round(y), 'text-anchor': anchor, class: kind });
    if (one.textContent !== content) one.textContent = content;
  }

  /** One picture. */
  draw(g, now, dt) {
    const [w, h] = this.size;
    if (!w || !h) return;
    // names are short in a narrow picture; values move out of the way already in a middling one
    const narrow = w < 560;
    const small = w < 760;
    // the tallest of parent roll and windup, and room for its labels
    const centre = (r) => {
      // where the roll lies on both drums, seen from the rear drum's axis
      const d = g.rd + g.fd + g.gap;
      const [a, b] = [g.rd + r, g.fd + r];
      const x = (a * a - b * b + d * d) / (2 * d);
      return [x, Math.sqrt(Math.max(0, a * a - x * x))];
    };
    const drum = g.full * 0.14 + Math.max(g.rd, g.fd);
    const stack = drum + centre(g.shipping)[1] + g.shipping + 2 * g.rr + 0.12 * g.full;
    const tall = Math.max(2 * g.full + 0.16 * g.full, stack) + 0.1 * g.full;
    const least = 2 * g.full + 2 * (g.rd + g.fd) + g.gap + 0.7 * g.full;
    const scale = Math.min((h - 26) / tall, (w - 20) / least);
    const wide = w / scale;
    const floor = h - 22;
    const X = (x) => x * scale;
    const Y = (y) => floor - y * scale;

    const v = now.v / 60;
    const r_uw = Math.min(g.full, Math.max(g.spool, now.d_uw / 2000 || g.full));
    const r_wu = Math.max(g.core, now.d_wu / 2000 || g.core);
    const margin = Math.max(0.06 * g.full, 12 / scale);
    const axis = g.full * 1.12;
    const x_uw = margin + g.full;
    const x_fd = wide - margin - Math.max(g.fd + 0.06 * g.full, g.shipping - (g.rd + g.fd + g.gap) / 2);
    const x_rd = x_fd - (g.rd + g.fd + g.gap);

    // idle rolls between the unwind's right side and the rear drum's left, in the ratio of their spans
    const from = x_uw + g.full * 0.72;
    const to = x_rd - g.rd - 0.1 * g.full;
    const total = g.idle.reduce((sum, one) => sum + one.span, 0) + g.last || 1;
    let along = 0;
    const rolls = g.idle.map((one, i) => {
      along += one.span;
      // the last roll leads the web up to the drum from below, the others go over and under
      const over = (g.idle.length - 1 - i) % 2 === 1;
      const x = from + (to - from) * (g.idle.length === 1 ? 0.8 : along / total);
      return {
        x: X(x),
        y: Y(over ? g.full * 0.8 : g.full * 0.26 + one.r),
        r: one.r * scale,
        s: over ? 1 : -1,
        r_m: one.r,
      };
    });
    const parent = { x: X(x_uw), y: Y(axis), r: r_uw * scale, s: 1 };
    const rear = { x: X(x_rd), y: Y(drum), r: g.rd * scale, s: 1 };
    const front = { x: X(x_fd), y: Y(drum), r: g.fd * scale, s: 1 };
    const [cx, cy] = centre(r_wu);
    const ship = { x: X(x_rd + cx), y: Y(drum + cy), r: r_wu * scale, s: -1 };
    const lift = now.down ? 0 : 0.22 * g.full;
    const rider = { x: ship.x, y: ship.y - ship.r - (g.rr + lift) * scale, r: g.rr * scale, s: 1 };

    // frame
    set(this.floor, { d: `M${X(margin * 0.5)} ${floor}H${w - X(margin * 0.5)}` });
    const leg = (c, r) => `M${round(c.x - r)} ${floor}L${round(c.x)} ${round(c.y)}L${round(c.x + r)} ${floor}`;
    set(this.stands, {
      d:
        leg(parent, g.full * 0.42 * scale) +
        leg(rear, g.rd * 0.55 * scale) +
        leg(front, g.fd * 0.55 * scale) +
        rolls.map((c) => `M${round(c.x)} ${floor}V${round(c.y)}`).join(''),
    });
    const top = Y(stack);
    set(this.beam, {
      d: `M${round(rider.x - 2.2 * rider.r)} ${round(top)}h${round(4.4 * rider.r)}M${round(rider.x)} ${round(top)}V${round(rider.y)}`,
    });

    // rolls
    const per_minute = (2 * Math.PI) / 60;
    this.parent.draw(parent.x, parent.y, parent.r, 0.82, now.n.uw * per_minute, dt);
    this.spool.draw(parent.x, parent.y, g.spool * scale * 0.86, 0.6, now.n.uw * per_minute, dt);
    this.layers(parent, g.spool * scale);
    while (this.idle.length > rolls.length) this.idle.pop().group.remove();
    while (this.idle.length < rolls.length) this.idle.push(new Roll(this.idles, 'steel', 2));
    // idle rolls turn with the web, when there is one
    const led = now.threaded ? v : 0;
    rolls.forEach((c, i) => this.idle[i].draw(c.x, c.y, c.r, 0.62, (c.s * led) / c.r_m, dt));
    this.rd.draw(rear.x, rear.y, rear.r, 0.74, now.n.rd * per_minute, dt);
    this.fd.draw(front.x, front.y, front.r, 0.74, now.n.fd * per_minute, dt);
    this.wu.draw(ship.x, ship.y, ship.r, 0.8, -v / r_wu, dt);
    this.core.draw(ship.x, ship.y, g.core * scale * 0.9, 0.5, -v / r_wu, dt);
    this.rr.draw(rider.x, rider.y, rider.r, 0.62, now.n.rr * per_minute, dt);

    // web
    const circles = [parent, ...rolls, rear];
    const lines = circles.slice(1).map((c, i) => tangent(circles[i], c));
    // the web leaves the drum at its nip with the shipping roll
    const reach = Math.hypot(ship.x - rear.x, ship.y - rear.y) || 1;
    const nip = [rear.x + ((ship.x - rear.x) * rear.r) / reach, rear.y + ((ship.y - rear.y) * rear.r) / reach];
    let path = '';
    lines.forEach(([a, b], i) => {
      path += i ? arc(circles[i], lines[i - 1][1], a) : `M${point(a)}`;
      path += `L${point(b)}`;
    });
    path += arc(rear, lines[lines.length - 1][1], nip);
    set(this.ghost, { d: path, visibility: now.threaded ? 'hidden' : 'visible' });
    const ratio = now.tension_ref > 1 ? now.tension / now.tension_ref : now.tension > 5 ? 1 : 0;
    const slack = Math.max(0, 1 - ratio / (1 - USUAL));
    const kind = now.broken
      ? 'broken'
      : !now.threaded
        ? 'usual'
        : ratio > 1 + USUAL
          ? 'high'
          : slack > 0
            ? 'low'
            : 'usual';
    while (this.spans.length > lines.length) this.spans.pop().remove();
    while (this.spans.length < lines.length) this.spans.push(node(this.web, 'path'));
    set(this.web, { class: `web ${kind}`, visibility: now.threaded || now.broken ? 'visible' : 'hidden' });
    let torn = null;
    lines.forEach(([a, b], i) => {
      const last = i === lines.length - 1;
      const before = i ? arc(circles[i], lines[i - 1][1], a) : '';
      const start = `M${point(i ? lines[i - 1][1] : a)}${before}`;
      const length = Math.hypot(b[0] - a[0], b[1] - a[1]);
      const middle = [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2];
      if (now.broken === i + 1) {
        // two ends that hang down
        const at = (f, drop) => [a[0] + (b[0] - a[0]) * f, a[1] + (b[1] - a[1]) * f + drop];
        const drop = Math.min(0.25 * length, 0.3 * g.full * scale);
        torn = middle;
        set(this.spans[i], {
          d:
            `${start}Q${point(at(0.3, 0))} ${point(at(0.36, drop))}M${point(at(0.64, drop))}Q${point(at(0.7, 0))} ${point(b)}` +
            (last ? arc(rear, b, nip) : ''),
        });
        return;
      }
      const sag = now.broken ? SAG : SAG * slack;
      const hang = [middle[0], middle[1] + 2 * sag * Math.min(length, 0.9 * g.full * scale)];
      set(this.spans[i], { d: `${start}Q${point(hang)} ${point(b)}` + (last ? arc(rear, b, nip) : '') });
    });
    // marks that run along with the web, no faster than the eye can follow
    this.shift = (this.shift + Math.sign(v) * Math.min(Math.abs(v) * scale, 260) * dt) % 42;
    set(this.flow, {
      d: path,
      'stroke-dashoffset': round(-this.shift),
      visibility: now.threaded && !now.broken && slack < 0.5 && Math.abs(v) > 0.02 ? 'visible' : 'hidden',
    });
    if (torn) {
      const [x, y, s] = [torn[0], torn[1], 9];
      set(this.torn, {
        d: `M${x - s} ${y - s}l${2 * s} ${2 * s}M${x + s} ${y - s}l${-2 * s} ${2 * s}`,
        visibility: 'visible',
      });
    } else set(this.torn, { visibility: 'hidden' });

    // slitter behind the roll on the load cells, or before it when it is the last
    const cut = lines[Math.min(g.cells + 1, lines.length - 1)];
    const [kx, ky] = [cut[0][0] + (cut[1][0] - cut[0][0]) * 0.42, cut[0][1] + (cut[1][1] - cut[0][1]) * 0.42];
    const along_ = Math.atan2(cut[1][1] - cut[0][1], cut[1][0] - cut[0][0]);
    const kr = Math.max(4, 0.085 * g.full * scale);
    const side = (f) => ({
      cx: round(kx + f * kr * 0.86 * Math.sin(along_)),
      cy: round(ky - f * kr * 0.86 * Math.cos(along_)),
      r: round(kr),
    });
    set(this.upper, side(1));
    set(this.lower, side(-1));
    const on = rolls[Math.min(g.cells, rolls.length - 1)] ?? rear;
    const t = Math.max(5, on.r * 0.5);
    set(this.cell, {
      d: `M${round(on.x)} ${round(on.y + on.r + 2)}l${t} ${1.5 * t}h${-2 * t}Z`,
      class: `cell ${kind}`,
    });

    // brakes: shoes at the rolls, filled when closed
    for (const [name, path_] of this.brakes) {
      const c = { uw: parent, rd: rear, fd: front }[name];
      const r = name === 'uw' ? g.spool * scale : c.r * 0.5;
      const closed = now.brake[name];
      const o = closed ? 0 : Math.max(3, r * 0.16);
      const [bw, bh] = [Math.max(5, r * 0.3), Math.max(9, r * 0.72)];
      const shoe = (x) => `M${round(x)} ${round(c.y - bh / 2)}h${round(bw)}v${round(bh)}h${round(-bw)}Z`;
      set(path_, {
        d: shoe(c.x - r - o - bw * 0.5) + shoe(c.x + r + o - bw * 0.5),
        class: `brake ${name} ${closed ? 'closed' : ''}`,
      });
    }

    // labels in the picture; the same values stand as text beside it
    const mm = (d) => `Ø ${figure(d, 0)} mm`;
    const gap = 14;
    this.text('uw', parent.x, floor + 16, narrow ? 'UW' : 'Unwind', 'middle', 'name');
    this.text('rd', rear.x, floor + 16, narrow ? 'RD' : 'Rear drum', 'middle', 'name');
    this.text('fd', front.x, floor + 16, narrow ? 'FD' : 'Front drum', 'middle', 'name');
    this.text(
      'duw',
      parent.x,
      parent.y - g.spool * scale - (r_uw - g.spool) * scale * 0.36,
      r_uw * scale > 55 ? mm(now.d_uw) : '',
      'middle',
      'on',
    );
    // a narrow picture has no room beside its rolls: what has no place is above
    const label = ship.r > 46;
    this.text(
      'dwu',
      label ? ship.x : ship.x - ship.r - gap,
      label ? ship.y + Math.max(22, g.core * scale + 18) : Math.min(ship.y - ship.r * 0.3, rear.y - rear.r - 7),
      small && !label ? '' : mm(now.d_wu),
      label ? 'middle' : 'end',
      label ? 'on' : '',
    );
    const start = lines[0];
    const clear = rider.x - 2.2 * rider.r - 12;
    const [vx, vy] = small ? [clear, 22] : [(start[0][0] + start[1][0]) / 2 + 12, (start[0][1] + start[1][1]) / 2 - 14];
    const [tx, ty] = small ? [clear, 42] : [on.x - on.r - 9, on.y + on.r + t];
    this.text('v', vx, vy, `${figure(now.v, 0)} m/min`, small ? 'end' : 'start', 'big');
    this.text('t', tx, ty, `${figure(now.tension, 0)} N/m`, 'end', `big ${kind}`);
    this.text('sl', kx + kr * 2.1, ky + 4, narrow ? '' : 'Slitter', 'start', 'name');
    this.text(
      'rr',
      rider.x + 2.2 * rider.r + 8,
      top + 4,
      narrow ? '' : now.down ? 'Rider roll' : 'Rider roll lifted',
      'start',
      'name',
    );
    this.text('torn', torn ? torn[0] + 16 : 0, torn ? torn[1] + 24 : 0, torn ? 'Web break' : '', 'start', 'big broken');
  }

  /** Layers of paper: rings that stay where they are wound as the roll grows. */
  layers(c, inner) {
    const step = Math.max(7, (c.r - inner) / 6);
    let n = 0;
    for (let r = inner + step; r < c.r - 3; r += step) {
      const ring = this.rings.children[n] ?? node(this.rings, 'circle');
      set(ring, { cx: round(c.x), cy: round(c.y), r: round(r) });
      n++;
    }
    while (this.rings.children.length > n) this.rings.lastChild.remove();
  }
}

function present() {
  return untracked(() => ({
    v: value('v_web') || 0,
    tension: value('tension') || 0,
    tension_ref: value('tension_ref') || 0,
    d_uw: value('d_uw') || 0,
    d_wu: value('d_wu') || 0,
    n: { uw: value('n_uw') || 0, rd: value('n_rd') || 0, fd: value('n_fd') || 0, rr: value('n_rr') || 0 },
    threaded: bit('winder_status', 'web_threaded'),
    down: state.value === 'waiting' || bit('winder_status', 'rider_down'),
    broken: counts('broken_span').value || 0,
    brake: {
      uw: bit('winder_status', 'brake_uw'),
      rd: bit('winder_status', 'brake_rd'),
      fd: bit('winder_status', 'brake_fd'),
    },
  }));
}

/** The mimic of a machine. */
export function Mimic({ machine }) {
  const box = useRef();
  const latest = useRef(machine);
  latest.current = machine;
  useEffect(() => {
    const svg = box.current;
    const scene = new Scene(svg);
    const calm = matchMedia('(prefers-reduced-motion: reduce)');
    const fit = new ResizeObserver(([entry]) => {
      const { width, height } = entry.contentRect;
      scene.size = [width, height];
      svg.setAttribute('viewBox', `0 0 ${width} ${height}`);
    });
    fit.observe(svg);
    let before = 0;
    let frame;
    const picture = (at) => {
      const dt = calm.matches || state.value !== 'live' ? 0 : Math.min(0.1, (at - before) / 1000);
      before = at;
      scene.draw(latest.current, present(), dt);
      frame = requestAnimationFrame(picture);
    };
    frame = requestAnimationFrame(picture);
    return () => {
      cancelAnimationFrame(frame);
      fit.disconnect();
      svg.replaceChildren();
    };
  }, []);
  return html`<svg class="scene" ref=${box} role="img"
    aria-label="The winder: parent roll, web path, drums, shipping roll and rider roll, moving as they do" />`;
}
