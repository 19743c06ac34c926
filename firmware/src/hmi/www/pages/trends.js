/**
 * The trends page: live curves of any signals, with cursor, zoom, pause, trigger, CSV and PNG.
 *
 * Not here: the history, which `live.js` keeps whether this page is open or not. Drawing is uPlot's.
 */
import { html, signal, useEffect, useRef, useState } from '../vendor/ui.js';
import uPlot from '../vendor/uplot.js';
import { note, save } from '../api.js';
import { signals, history, listeners, scaled, value, digits, figure, want, cycle, CYCLE_S } from '../live.js';
import { Icon, Field } from '../parts.js';

document.head.append(Object.assign(document.createElement('link'), { rel: 'stylesheet', href: '/vendor/uplot.css' }));

/** Colours that the colour-blind tell apart (Okabe and Ito), and a dash for the second round. */
const COLOURS = {
  light: ['#0072b2', '#c24e00', '#007a5a', '#a8447f', '#8a6d00', '#2f8fc4', '#333333'],
  dark: ['#56b4e9', '#ff9a5c', '#3ecf9f', '#e59ac6', '#e6c84b', '#9fd3f5', '#eeeeee'],
};
const DASHES = [[], [7, 4], [2, 3]];

/** The paper's figures, and what else is looked at together. */
const PRESETS = [
  ['Speed', 'figures 7 and 8', ['v_ref', 'v_web']],
  ['Tension', 'figures 9 and 10', ['tension_ref', 'tension']],
  ['Torques', 'figures 11 and 12', ['torque_uw', 'torque_rd', 'torque_fd', 'torque_rr']],
  ['Diameters', 'figures 13 and 14', ['d_uw', 'd_wu']],
  ['Overview', 'speed, tension, diameter', ['v_web', 'tension', 'd_wu']],
  ['Power', 'all four motors', ['power_uw', 'power_rd', 'power_fd', 'power_rr']],
];
const WINDOWS = [10, 30, 60, 300, 600];
/** Pictures a second. */
const RATE = 12;

/** What the page keeps while another one is shown. */
const kept = { pens: PRESETS[4][2], window: 60, trigger: { name: 'tension', edge: 'falls', level: '70', before: '5' } };

/** The trigger, which waits whether this page is shown or not: `off`, `armed` or `fired`. */
const armed = signal('off');
/** The end of the window that it holds, s. */
let held = null;
let disarm = () => {};

/** Looks at every row that comes; when the trigger fires, the rest of the window still fills. */
function arm(trigger, seconds) {
  disarm();
  held = null;
  let before = null;
  let fired = null;
  const about = signals.value.get(trigger.name);
  const level = Number(trigger.level);
  const ahead = Math.min(Number(trigger.before) || 0, seconds);
  const stop = want([trigger.name]);
  const look = (at) => {
    if (fired !== null) {
      if (at * CYCLE_S < fired + seconds - ahead) return;
      held = fired + seconds - ahead;
      disarm();
      armed.value = 'fired';
      return;
    }
    const [, column] = history.rows([trigger.name], at, at);
    if (!column.length || column[0] === null) return;
    const v = scaled(about, column[0]);
    if (before !== null && (trigger.edge === 'rises' ? before < level && v >= level : before > level && v <= level)) {
      fired = at * CYCLE_S;
      note(
        `Trigger: ${trigger.name} ${trigger.edge === 'rises' ? 'rose above' : 'fell below'} ${trigger.level} ${about.unit} at ${fired.toFixed(2)} s`,
      );
    }
    before = v;
  };
  disarm = () => {
    listeners.delete(look);
    stop();
    armed.value = 'off';
    disarm = () => {};
  };
  listeners.add(look);
  armed.value = 'armed';
}

/** The colour that a custom property stands for. */
function resolved(name) {
  const probe = document.createElement('i');
  probe.className = 'probe ' + name;
  document.body.append(probe);
  const { color } = getComputedStyle(probe);
  probe.remove();
  return color;
}

const dark = () => {
  const [r, g, b] = resolved('text').match(/\d+/g).map(Number);
  return r + g + b > 380;
};

/** A curve table: seconds and values in their units, of the pens' rows. */
function table(pens, from, to) {
  const [cycles, ...columns] = history.rows(pens, from, to);
  return [
    cycles.map((c) => c * CYCLE_S),
    ...columns.map((column, i) => {
      const about = signals.value.get(pens[i]);
      return column.map((raw) => (raw === null ? null : scaled(about, raw)));
    }),
  ];
}

/** The rows as CSV: cycle, time, and each pen in its unit with all its digits. */
export function csv(pens, from, to) {
  const abouts = pens.map((name) => signals.value.get(name));
  const head = ['cycle', 't_s', ...abouts.map((a) => (a.unit ? `${a.name} [${a.unit}]` : a.name))];
  const [cycles, ...columns] = history.rows(pens, from, to);
  const lines = cycles.map((c, i) =>
    [
      c,
      (c * CYCLE_S).toFixed(2),
      ...columns.map((column, n) =>
        column[i] === null ? '' : scaled(abouts[n], column[i]).toFixed(digits(abouts[n])),
      ),
    ].join(','),
  );
  return [head.join(','), ...lines].join('\n') + '\n';
}

function options(pens, width, height, hooks) {
  const colours = COLOURS[dark() ? 'dark' : 'light'];
  const [text, line] = [resolved('quiet'), resolved('line')];
  const font = '12px Inter, system-ui, sans-serif';
  const units = [...new Set(pens.map((name) => signals.value.get(name)?.unit ?? ''))];
  const narrow = width < 560;
  const grid = { stroke: line, width: 1 };
  // an axis that is one pen's alone has its colour
  const own = (unit) => {
    const pen = pens.findIndex((name) => (signals.value.get(name)?.unit ?? '') === unit);
    const last = pens.findLastIndex((name) => (signals.value.get(name)?.unit ?? '') === unit);
    return units.length > 1 && pen === last ? colours[pen % colours.length] : null;
  };
  const time = (u, ticks) =>
    ticks.map((s) =>
      s < 0 ? '' : `${Math.floor(s / 60)}:${(s % 60).toFixed(s % 1 ? 1 : 0).padStart(s % 1 ? 4 : 2, '0')}`,
    );
  return {
    width,
    height,
    legend: { show: false },
    cursor: { drag: { x: true, y: false, uni: 20 }, points: { size: 7 } },
    scales: Object.fromEntries([
      ['x', { time: false }],
      ...units.map((unit) => [unit || 'none', { range: (u, low, high) => room(low, high, unit) }]),
    ]),
    axes: [
      { stroke: text, grid, ticks: grid, font, values: time, size: 34 },
      ...units.map((unit, i) => ({
        scale: unit || 'none',
        side: i % 2 ? 1 : 3,
        show: i < (narrow ? 2 : 4),
        stroke: own(unit) ?? text,
        font,
        grid: i ? { show: false } : grid,
        ticks: grid,
        label: narrow ? undefined : unit,
        labelFont: font,
        labelSize: 18,
        size: narrow ? 42 : 54,
        values: (u, splits, axis, space, step) =>
          splits.map((v) => (v === null ? '' : figure(v, Math.max(0, Math.ceil(-Math.log10(step) - 1e-9))))),
      })),
    ],
    series: [
      {},
      ...pens.map((name, i) => ({
        label: name,
        scale: signals.value.get(name)?.unit || 'none',
        stroke: colours[i % colours.length],
        dash: DASHES[Math.floor(i / colours.length) % DASHES.length],
        width: 1.6,
        points: { show: false },
        spanGaps: false,
      })),
    ],
    hooks,
  };
}

/** The least that an axis spans, by unit, so that a quiet curve lies still. */
const LEAST = { 'm/min': 20, 'N/m': 40, mm: 20, '%': 20, kW: 20, '1/min': 20 };

/** The range of an axis: room above and below, and the zero where it is near. */
function room(low, high, unit) {
  if (low === null || high === null) return [0, LEAST[unit] ?? 1];
  if (low > 0 && low < 0.6 * high) low = 0;
  const span = Math.max(high - low, LEAST[unit] ?? 1);
  const middle = (low + high) / 2;
  const bottom = low === 0 ? 0 : middle - span * 0.55;
  return [bottom, Math.max(middle + span * 0.55, bottom + span)];
}

export default function Trends() {
  const [pens, setPens] = useState(kept.pens);
  const [seconds, setSeconds] = useState(kept.window);
  const [paused, setPaused] = useState(held !== null);
  const [zoomed, setZoomed] = useState(false);
  const [cursor, setCursor] = useState(null);
  const [adding, setAdding] = useState('');
  const [trigger, setTrigger] = useState(kept.trigger);
  const [theme, setTheme] = useState(document.documentElement.dataset.theme);
  const box = useRef();
  const plot = useRef();
  const view = useRef({ frozen: held, zoom: null });
  Object.assign(kept, { pens, window: seconds, trigger });

  useEffect(() => want(pens), [pens.join()]);
  useEffect(() => {
    const seen = new MutationObserver(() => setTheme(document.documentElement.dataset.theme + Date.now()));
    seen.observe(document.documentElement, { attributes: true, attributeFilter: ['data-theme'] });
    const scheme = matchMedia('(prefers-color-scheme: dark)');
    const change = () => setTheme('' + Date.now());
    scheme.addEventListener('change', change);
    return () => (seen.disconnect(), scheme.removeEventListener('change', change));
  }, []);

  // the plot is made anew for other pens or colours
  const ready = signals.value.size > 0;
  useEffect(() => {
    if (!ready) return undefined;
    const size = () => ({ width: box.current.clientWidth, height: box.current.clientHeight });
    const made = new uPlot(
      options(pens, size().width, size().height, {
        setCursor: [
          (u) =>
            setCursor(
              u.cursor.idx === null || u.cursor.idx === undefined
                ? null
                : { t: u.data[0][u.cursor.idx], values: u.data.slice(1).map((c) => c[u.cursor.idx]) },
            ),
        ],
        setSelect: [
          (u) => {
            if (u.select.width < 4) return;
            const range = [u.posToVal(u.select.left, 'x'), u.posToVal(u.select.left + u.select.width, 'x')];
            view.current.zoom = range;
            setZoomed(true);
            setPaused(true);
          },
        ],
      }),
      [[], ...pens.map(() => [])],
      box.current,
    );
    plot.current = made;
    const fit = new ResizeObserver(() => box.current && made.setSize(size()));
    fit.observe(box.current);
    draw(true);
    return () => (fit.disconnect(), made.destroy(), (plot.current = null));
  }, [pens.join(), theme, ready]);

  function range() {
    if (view.current.zoom) return view.current.zoom;
    const end = view.current.frozen ?? cycle.peek() * CYCLE_S;
    return [end - seconds, end];
  }
  function draw(force) {
    const made = plot.current;
    if (!made || (!force && view.current.frozen !== null)) return;
    const [from, to] = range();
    // one row more on each side, so that curves reach the edge
    made.setData(table(pens, from / CYCLE_S - 8, to / CYCLE_S + 8), false);
    // the scales of y follow what is seen
    made.batch(() => {
      made.setScale('x', { min: from, max: to });
    });
  }
  useEffect(() => {
    view.current.frozen = paused ? (view.current.frozen ?? cycle.peek() * CYCLE_S) : null;
    if (!paused) {
      held = null;
      view.current.zoom = null;
      setZoomed(false);
    }
    draw(true);
  }, [paused]);
  useEffect(() => draw(true), [seconds, zoomed]);
  useEffect(() => {
    let last = 0;
    const one = () => {
      const now = performance.now();
      if (now - last < 1000 / RATE) return;
      last = now;
      draw(false);
    };
    listeners.add(one);
    return () => listeners.delete(one);
  }, [pens.join(), seconds]);

  useEffect(() => {
    if (armed.value !== 'fired' || held === null) return;
    view.current.frozen = held;
    setPaused(true);
  }, [armed.value]);

  const all = [...signals.value.values()].filter((s) => s.direction === 'feedback');
  const colours = COLOURS[dark() ? 'dark' : 'light'];
  const add = (name) => {
    if (signals.value.get(name)?.direction === 'feedback' && !pens.includes(name)) setPens([...pens, name]);
    setAdding('');
  };
  const bounds = () => range().map((t) => t / CYCLE_S);
  const png = () => {
    const source = plot.current.ctx.canvas;
    const made = document.createElement('canvas');
    const unit = source.width / plot.current.width;
    made.width = source.width;
    made.height = source.height + 34 * unit;
    const c = made.getContext('2d');
    c.fillStyle = resolved('card');
    c.fillRect(0, 0, made.width, made.height);
    c.drawImage(source, 0, 34 * unit);
    c.font = `${13 * unit}px Inter, system-ui, sans-serif`;
    let x = 14 * unit;
    pens.forEach((name, i) => {
      c.fillStyle = colours[i % colours.length];
      c.fillRect(x, 16 * unit, 18 * unit, 3 * unit);
      c.fillStyle = resolved('text');
      const label = `${name}  ${signals.value.get(name)?.unit ?? ''}`;
      c.fillText(label, x + 24 * unit, 22 * unit);
      x += c.measureText(label).width + 44 * unit;
    });
    made.toBlob((blob) => save('trends.png', blob));
  };
  const same = (list) => list.join() === pens.join();

  return html`<div class="head"><h1>Trends</h1>
      <div class="pick" role="group" aria-label="Window">
        ${WINDOWS.map((s) => html`<button type="button" key=${s} aria-pressed=${s === seconds ? 'true' : 'false'}
          onClick=${() => setSeconds(s)}>${s < 60 ? `${s} s` : `${s / 60} min`}</button>`)}</div>
      <button type="button" class=${paused ? 'main' : ''} aria-pressed=${paused ? 'true' : 'false'}
        onClick=${() => setPaused(!paused)}><${Icon} name=${paused ? 'play' : 'pause'} /> ${paused ? 'Go on' : 'Pause'}
          </button>
    </div>
    <div class="trends">
      <section class="card plot" aria-label="Curves">
        <div class="presets" role="group" aria-label="Presets">
          ${PRESETS.map(([name, what, list]) => html`<button type="button" key=${name} class="small" title=${what}
            aria-pressed=${same(list) ? 'true' : 'false'} onClick=${() => setPens(list)}>${name}</button>`)}</div>
        <div class="canvas" ref=${box} role="img"
          aria-label=${`Curves of ${pens.join(', ')}; the values stand in the list of pens`} />
        <div class="row spread under">
          <span class="quiet">
            ${zoomed ? 'Zoomed' : paused ? 'Paused' : 'Drag over the curves to zoom'}${cursor ? html`, cursor at <b>
              ${cursor.t.toFixed(2)} s</b>` : ''}</span>
          <span class="row">${zoomed ? html`<button type="button" class="small"
            onClick=${() => ((view.current.zoom = null), setZoomed(false))}>Whole window</button>` : null}
            <button type="button" class="small"
              onClick=${() => save('trends.csv', new Blob([csv(pens, ...bounds())], { type: 'text/csv' }))}>CSV</button>
            <button type="button" class="small" onClick=${png}>PNG</button></span>
        </div>
      </section>
      <section class="card pens" aria-label="Pens">
        <h2>Pens</h2>
        <ul>${pens.map((name, i) => {
          const about = signals.value.get(name);
          return html`<li key=${name}>
            <svg viewBox="0 0 26 8" aria-hidden="true">
              <line x1="1" x2="25" y1="4" y2="4" stroke=${colours[i % colours.length]} stroke-width="3"
                stroke-dasharray=${DASHES[Math.floor(i / colours.length) % 3].join(' ')} /></svg>
            <span title=${about?.description}><code>${name}</code></span>
            <${Now} name=${name} at=${cursor?.values[i]} />
            <button type="button" class="plain" aria-label=${`Remove ${name}`}
              onClick=${() => setPens(pens.filter((p) => p !== name))} disabled=${pens.length === 1}>
                <${Icon} name="close" /></button></li>`;
        })}</ul>
        <${Field} label="Add a signal">
          ${(a) => html`<select ...${a} value=${adding} onChange=${(e) => add(e.target.value)}>
            <option value="">choose …</option>
              ${all.filter((s) => !pens.includes(s.name)).map((s) => html`<option key=${s.name} value=${s.name}>
                ${s.name}${s.unit ? ` [${s.unit}]` : ''}</option>`)}</select>`}<//>
        <h2>Trigger</h2>
        <div class="trigger">
          <${Field} label="Signal">${(a) => html`<select ...${a} value=${trigger.name} disabled=${armed.value === 'armed'}
            onChange=${(e) => setTrigger({ ...trigger, name: e.target.value })}>
              ${all.map((s) => html`<option key=${s.name}>${s.name}</option>`)}</select>`}<//>
          <${Field} label="Edge">${(a) => html`<select ...${a} value=${trigger.edge} disabled=${armed.value === 'armed'}
            onChange=${(e) => setTrigger({ ...trigger, edge: e.target.value })}>
              <option value="rises">rises above</option><option value="falls">falls below</option></select>`}<//>
          <${Field} label="Level" unit=${signals.value.get(trigger.name)?.unit}>
            ${(a) => html`<input ...${a} type="number" step="any" value=${trigger.level} disabled=${armed.value === 'armed'}
              onInput=${(e) => setTrigger({ ...trigger, level: e.target.value })} />`}<//>
          <${Field} label="History before" unit="s">
            ${(a) => html`<input ...${a} type="number" min="0" max=${seconds} value=${trigger.before}
              disabled=${armed.value === 'armed'} onInput=${(e) => setTrigger({ ...trigger, before: e.target.value })} />`}
                <//>
        </div>
        <button type="button" class=${armed.value === 'armed' ? 'main' : ''}
          onClick=${() => (armed.value === 'armed' ? disarm() : (setPaused(false), arm(trigger, seconds)))}>
            ${{ armed: 'Armed: waiting; disarm', fired: 'Fired; arm again' }[armed.value] ?? 'Arm'}</button>
      </section>
    </div>`;
}

/** The value under the cursor, or the present one. */
function Now({ name, at }) {
  const about = signals.value.get(name);
  if (!about) return null;
  const v = at === undefined ? value(name) : at;
  return html`<span class="num"><b>${v === null ? '–' : figure(v, digits(about) > 1 ? 2 : digits(about))}</b>
    ${about.unit ? html`<i>${about.unit}</i>` : null}</span>`;
}
