/**
 * The live stream: the signal list, the present values, and the history that trends are drawn from.
 *
 * Not here: drawing. Values stay raw counts until somebody looks at them, so that what is exported is what came.
 */
import { signal, computed } from './vendor/ui.js';
import { get } from './api.js';

/** Every signal by its name; empty before the list has come. */
export const signals = signal(new Map());
/** `waiting`, `live` or `lost`. */
export const state = signal('waiting');
/** The drive cycle of the last values. */
export const cycle = signal(0);

/** Time of a drive cycle, s. */
export const CYCLE_S = 0.01;
/** Values a second that are asked for. */
const RATE = 25;
/** Rows of history: ten minutes of them. */
const ROWS = 600 * RATE;
/** The stream is lost when nothing came for this long, ms. */
const SILENCE = 3000;

/** What every page needs, and what trends show of the time before they were opened. */
const ALWAYS = (
  'mode fault refusal winder_status warnings broken_span v_web v_ref a_ref tension tension_ref d_uw ' +
  'd_wu length_wu n_uw n_rd n_fd n_rr torque_uw torque_rd torque_fd torque_rr power_uw power_rd ' +
  'power_fd power_rr zsw1_uw zsw1_rd zsw1_fd zsw1_rr rider_load'
).split(' ');

const cells = new Map();
/** The counts of a signal, as a signal of the page. */
export function counts(name) {
  let cell = cells.get(name);
  if (!cell) cells.set(name, (cell = signal(null)));
  return cell;
}

/** Counts in the unit of their signal. */
export const scaled = (about, raw) => (raw === null || raw === undefined ? NaN : raw / about.counts);

/** The present value in the unit of the signal; NaN before it is known. */
export function value(name) {
  const raw = counts(name).value;
  const about = signals.value.get(name);
  return about ? scaled(about, raw) : NaN;
}

/** Digits behind the point that the counts of a signal have. */
export const digits = (about) => Math.max(0, Math.ceil(Math.log10(about.counts) - 1e-9));

/** A number for people: a thin space every three digits, a true minus. */
export function figure(number, places) {
  if (!Number.isFinite(number)) return '–';
  const [whole, part] = Math.abs(number).toFixed(places).split('.');
  const text = whole.replace(/\B(?=(\d{3})+$)/g, '\u2009') + (part ? '.' + part : '');
  return number < 0 && /[1-9]/.test(text) ? '\u2212' + text : text;
}

/** The text of a value, updated by itself. */
export const text = (name, places) =>
  computed(() => {
    const about = signals.value.get(name);
    return about ? figure(value(name), places ?? digits(about)) : '–';
  });

/** Whether a named bit of a signal is set. */
export function bit(name, of) {
  const about = signals.value.get(name)?.bits?.find((b) => b.name === of);
  return about ? ((counts(name).value >> about.number) & 1) === 1 : false;
}

/** The text of a code. */
export const code = (name) => signals.value.get(name)?.codes?.[counts(name).value] ?? '';

/** A ring of rows, each a cycle and the counts of all signals that came with it. */
class History {
  constructor() {
    this.clear();
  }
  clear() {
    this.cycles = new Float64Array(ROWS);
    this.columns = new Map();
    this.next = 0;
    this.length = 0;
  }
  push(at, names, row) {
    const last = this.length ? this.cycles[(this.next + ROWS - 1) % ROWS] : -1;
    // another time: the simulator has started again, or gone back to a snapshot
    if (at < last) this.clear();
    if (at === last) return;
    const i = this.next;
    this.cycles[i] = at;
    // a column whose signal did not come must not show what stood here a turn ago
    for (const column of this.columns.values()) column[i] = NaN;
    names.forEach((name, n) => {
      let column = this.columns.get(name);
      if (!column) this.columns.set(name, (column = new Float64Array(ROWS).fill(NaN)));
      column[i] = row[n + 1];
    });
    this.next = (i + 1) % ROWS;
    this.length = Math.min(this.length + 1, ROWS);
  }
  /** The rows from a cycle to another, oldest first: `[cycles, counts of each name]`. */
  rows(names, from = -Infinity, to = Infinity) {
    const first = (this.next + ROWS - this.length) % ROWS;
    const out = [[], ...names.map(() => [])];
    const columns = names.map((name) => this.columns.get(name));
    // the first row not before `from`, by halving
    let low = 0;
    let high = this.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.cycles[(first + middle) % ROWS] < from) low = middle + 1;
      else high = middle;
    }
    for (let k = low; k < this.length; k++) {
      const i = (first + k) % ROWS;
      if (this.cycles[i] > to) break;
      out[0].push(this.cycles[i]);
      columns.forEach((column, n) => {
        const raw = column ? column[i] : NaN;
        out[n + 1].push(Number.isNaN(raw) ? null : raw);
      });
    }
    return out;
  }
}
/** What came, of the last ten minutes. */
export const history = new History();

/** Called with the cycle after every message. */
export const listeners = new Set();

const wanted = new Map();
let socket = null;
let names = [];
let heard = 0;
let pause = 500;

function ask() {
  if (socket?.readyState !== WebSocket.OPEN || !signals.value.size) return;
  const all = new Set([...ALWAYS, ...[...wanted.values()].flat()].filter((name) => signals.value.has(name)));
  socket.send(JSON.stringify({ signals: [...all], hz: RATE }));
}

/** Wants signals for as long as a page shows them; the answer ends it. */
export function want(list) {
  const key = {};
  wanted.set(key, list);
  ask();
  return () => {
    wanted.delete(key);
    ask();
  };
}

function connect() {
  const scheme = location.protocol === 'https:' ? 'wss' : 'ws';
  socket = new WebSocket(`${scheme}://${location.host}/api/v1/live`);
  socket.onopen = () => {
    pause = 500;
    heard = Date.now();
    ask();
  };
  socket.onmessage = ({ data }) => {
    const message = JSON.parse(data);
    heard = Date.now();
    if (!Array.isArray(message)) {
      if (message.signals) names = message.signals;
      return;
    }
    history.push(message[0], names, message);
    names.forEach((name, i) => (counts(name).value = message[i + 1]));
    cycle.value = message[0];
    state.value = 'live';
    listeners.forEach((listener) => listener(message[0]));
  };
  socket.onclose = () => {
    if (state.value === 'live') state.value = 'lost';
    setTimeout(connect, pause);
    pause = Math.min(5000, pause * 2);
  };
}

/** Fetches the list and begins. */
export async function start() {
  connect();
  setInterval(() => {
    if (state.value === 'live' && Date.now() - heard > SILENCE) {
      state.value = 'lost';
      socket.close();
    }
  }, 1000);
  for (;;) {
    try {
      const list = await get('signals');
      signals.value = new Map(list.map((s) => [s.name, s]));
      break;
    } catch {
      await new Promise((wait) => setTimeout(wait, 1000));
    }
  }
  ask();
}
