/**
 * What several pages are made of: numbers, bars, lamps, fields, icons, dialogs.
 *
 * Not here: anything that knows a page.
 */
import { html, useEffect, useRef, useState, useMemo, useId } from './vendor/ui.js';
import { signals, text, value, counts, want } from './live.js';
import { get } from './api.js';

const PATHS = {
  machine: 'M2 15h20M6 12a4 4 0 1 0 0-8 4 4 0 0 0 0 8Zm11 0a3 3 0 1 0 0-6 3 3 0 0 0 0 6ZM6 4h11M4 20h16',
  trends: 'M3 3v18h18M6 15l4-6 4 4 6-8',
  parameters:
    'M4 7h10m4 0h2M4 17h2m4 0h10M16 9.5a2.5 2.5 0 1 0 0-5 2.5 2.5 0 0 0 0 5ZM8 19.5a2.5 2.5 0 1 0 0-5 2.5 2.5 0 0 0 0 5Z',
  autotune: 'M4 19a9 9 0 1 1 16 0M12 14l5-5M12 16a2 2 0 1 0 0-4 2 2 0 0 0 0 4Z',
  drive: 'M13 2 5 14h6l-1 8 8-12h-6l1-8Z',
  faults: 'M12 3 2 20h20L12 3ZM12 10v4M12 17v.5',
  link: 'M10 14a4 4 0 0 0 6 0l3-3a4 4 0 0 0-6-6l-1 1M14 10a4 4 0 0 0-6 0l-3 3a4 4 0 0 0 6 6l1-1',
  session: 'M12 7v5l3 2M4 12a8 8 0 1 0 3-6.2L4 8M4 4v4h4',
  acceptance: 'M9 4h6v3H9ZM8 5H5v16h14V5h-3M8 14l3 3 5-6',
  training: 'm2 9 10-5 10 5-10 5L2 9Zm4 2v5c3 3 9 3 12 0v-5M22 9v6',
  health: 'M3 12h4l2-6 4 12 2-6h6',
  sun: 'M12 16a4 4 0 1 0 0-8 4 4 0 0 0 0 8ZM12 2v3M12 19v3M2 12h3M19 12h3M5 5l2 2M17 17l2 2M19 5l-2 2M7 17l-2 2',
  moon: 'M20 14A8 8 0 0 1 10 4a8 8 0 1 0 10 10Z',
  auto: 'M12 21a9 9 0 1 0 0-18 9 9 0 0 0 0 18ZM12 3v18M12 7h5M12 11h8M12 15h7',
  key: 'M8 16a4 4 0 1 0 0-8 4 4 0 0 0 0 8ZM12 12h9v3M17 12v3',
  check: 'm5 12 5 5 9-10',
  close: 'm6 6 12 12M18 6 6 18',
  undo: 'M4 9h10a5 5 0 0 1 0 10H9M8 5 4 9l4 4',
  pause: 'M8 5v14M16 5v14',
  play: 'M7 4v16l13-8L7 4Z',
};
/** A drawn sign; what it means stands beside it. */
export const Icon = ({ name }) =>
  html`<svg class="icon" viewBox="0 0 24 24" aria-hidden="true"><path d=${PATHS[name]} /></svg>`;

/** A live number with its unit. */
export function Num({ name, places, unit }) {
  const shown = useMemo(() => text(name, places), [name, places]);
  const of = unit ?? signals.value.get(name)?.unit;
  return html`<span class="num"><b>${shown}</b>${of ? html`<i>${of}</i>` : null}</span>`;
}

/** Wants signals of the stream while the component is there. */
export function useLive(names) {
  useEffect(() => want(names), [names.join()]);
}

/** Reads a path of the API now and every `period` ms: `[answer, error, again]`. */
export function useGet(path, period) {
  const [answer, set] = useState([null, null]);
  const load = useRef();
  load.current = async () => {
    try {
      set([await get(path), null]);
    } catch (error) {
      set(([old]) => [old, error.message]);
    }
  };
  useEffect(() => {
    load.current();
    if (!period) return undefined;
    const timer = setInterval(() => document.hidden || load.current(), period);
    return () => clearInterval(timer);
  }, [path, period]);
  return [...answer, () => load.current()];
}

/** A bar from its zero, with a mark where the value should be. */
export function Bar({ name, low, high, reference, label }) {
  const at = (v) => Math.min(100, Math.max(0, ((v - low) / (high - low)) * 100));
  const [from, to] = [at(0), at(value(name) || 0)];
  const fill = { left: Math.min(from, to) + '%', width: Math.abs(to - from) + '%' };
  return html`<span class="bar" role="img" aria-label=${label}>
    ${low < 0 ? html`<span class="zero" style=${{ left: from + '%' }} />` : null}
    <span class="fill" style=${fill} />
    ${reference ? html`<span class="mark" style=${{ left: at(value(reference) || 0) + '%' }} />` : null}
  </span>`;
}

/** A lamp: shape and word, not colour alone. */
export const Lamp = ({ on, kind = 'on', children }) =>
  html`<span class=${`lamp ${on ? kind : ''}`}><span class="dot" aria-hidden="true" />${children}</span>`;

/** The bits of a word, each with what it means. */
export function Bits({ name }) {
  const about = signals.value.get(name);
  if (!about) return null;
  const word = counts(name).value ?? 0;
  const hex = word.toString(16).toUpperCase().padStart(4, '0');
  return html`<div class="bits">
    <h4><code>${name}</code> <span class="hex">${hex}<small> hex</small></span></h4>
    <ul>
      ${about.bits.map((b) => {
        const on = (word >> b.number) & 1;
        const bad = /fault|break|inhibit|warning|refused/.test(b.name) && on;
        return html`<li class=${on ? 'on' : ''} key=${b.number}>
          <${Lamp} on=${on} kind=${bad ? 'warn' : 'on'}>
            <span class="n">${b.number}</span><span class="v">${on}</span>
            <span class="what">${b.description}</span><//>
        </li>`;
      })}
    </ul>
  </div>`;
}

/** A dialog that keeps the keyboard inside, and closes with Escape. */
export function Dialog({ title, onclose, children }) {
  const box = useRef();
  const id = useId();
  useEffect(() => {
    const before = document.activeElement;
    if (!box.current.open) box.current.showModal();
    return () => before?.focus?.();
  }, []);
  return html`<dialog ref=${box} aria-labelledby=${id} onClose=${onclose}
    onClick=${(e) => e.target === box.current && onclose()}>
    <div class="inside"><h2 id=${id}>${title}</h2>${children}</div>
  </dialog>`;
}

/** A labelled field. */
export function Field({ label, unit, error, children, hint }) {
  const id = useId();
  return html`<div class=${`field ${error ? 'bad' : ''}`}>
    <label for=${id}>${label}</label>
    <span class="box">
      ${children({ id, 'aria-invalid': error ? 'true' : undefined, 'aria-describedby': error || hint ? id + 'e' : undefined })}${
      unit ? html`<i>${unit}</i>` : null
    }</span>
    ${error || hint ? html`<small id=${id + 'e'} role=${error ? 'alert' : undefined}>${error || hint}</small>` : null}
  </div>`;
}

/** A switch. */
export const Switch = ({ on, onchange, label, disabled }) =>
  html`<button type="button" class="switch" role="switch" aria-checked=${on ? 'true' : 'false'} disabled=${disabled}
    onClick=${() => onchange(!on)}><span class="knob" aria-hidden="true" /><span>${label}</span></button>`;

/** As a sentence begins. */
export const sentence = (words) => words.charAt(0).toUpperCase() + words.slice(1);

/** Time for people. */
export function span(seconds) {
  if (!Number.isFinite(seconds)) return '–';
  const s = Math.floor(seconds);
  const two = (n) => String(n).padStart(2, '0');
  return s >= 3600
    ? `${Math.floor(s / 3600)}:${two(Math.floor(s / 60) % 60)}:${two(s % 60)}`
    : `${Math.floor(s / 60)}:${two(s % 60)}`;
}

/** The names of the sections. */
export const SECTIONS = [
  ['uw', 'Unwind'],
  ['rd', 'Rear drum'],
  ['fd', 'Front drum'],
  ['rr', 'Rider roll'],
];
