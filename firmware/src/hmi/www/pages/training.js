/**
 * The training page: lessons with a goal, hints and a score, at the operator's desk.
 *
 * Not here: what a lesson asks for; that is in the lessons' files, which the command line tool plays, too. A PLC that is
 * wired follows the desk; where there is none, the operator panel does.
 */
import { html, signal, useEffect, useState } from '../vendor/ui.js';
import { attempt, get, info } from '../api.js';
import { counts, cycle, listeners, signals, want, CYCLE_S } from '../live.js';
import { Field, Icon, Num, useGet, useLive, sentence, span } from '../parts.js';

/** A push-button is pressed for so long, ms. */
const PRESS = 300;
/** The machine of the lessons. */
const MACHINE = 'NEWS-8000';
/** The simulator is the machine at power-up, and has its new commands, after so many cycles. */
const SETTLED = 50;
/** Looks at whether the machine is at power-up, at most. */
const TRIES = 20;
/** What is no lesson's. */
const UNUSED = /^(jog_|reset_sets)/;
const FIELDS = [
  ['operator_parent', 'Parent roll, measured'],
  ['operator_v_set', 'Web speed'],
  ['operator_tension_set', 'Tension'],
  ['operator_length_set', 'Length of the set'],
];
const SHOWN = [
  ['v_web', 'Web speed'],
  ['tension', 'Tension'],
  ['tension_ref', 'Its reference'],
  ['torque_uw', 'Unwind torque'],
  ['d_uw', 'Parent roll'],
  ['length_wu', 'Wound'],
];

/** The lesson that is played: it goes on when another page is shown. */
const play = signal(null);
/** Points of each lesson, of its last time. */
const points = signal({});

const operators = {
  '!=': (a, b) => a !== b,
  '<=': (a, b) => a <= b,
  '>=': (a, b) => a >= b,
  '<': (a, b) => a < b,
  '>': (a, b) => a > b,
  '=': (a, b) => a === b,
};

/** The signal of a name, and its bit where one is meant. */
function place(name) {
  const [word, bit] = name.split('.');
  const about = signals.value.get(word);
  return { word, about, bit: about?.bits.find((b) => b.name === bit) };
}

function valueOf(name) {
  const { word, about, bit } = place(name);
  const raw = counts(word).value;
  if (!about || raw === null) return NaN;
  return bit ? (raw >> bit.number) & 1 : raw / about.counts;
}

/** What a name is compared with: a number, so many times another signal, or the beginning of a code's text. */
function reference(name, text) {
  const times = text.match(/^([\d.]+) \* (\S+)$/);
  if (times) return Number(times[1]) * valueOf(times[2]);
  if (Number.isFinite(Number(text))) return Number(text);
  const wanted = text.replace(/'/g, '').toLowerCase();
  const codes = place(name).about?.codes ?? [];
  const exact = codes.findIndex((code) => code.toLowerCase() === wanted);
  return exact >= 0 ? exact : codes.findIndex((code) => code.toLowerCase().startsWith(wanted));
}

const TERM = /^(\S+) (!=|<=|>=|<|>|=) (.+)$/;

/** Whether a condition holds now; the lessons' files have its form. */
function holds(condition) {
  return condition.split(' and ').every((term) => {
    const [, name, operator, text] = term.match(TERM) ?? [];
    if (name) return operators[operator](valueOf(name), reference(name, text));
    return term.startsWith('not ') ? valueOf(term.slice(4)) === 0 : valueOf(term) === 1;
  });
}

/** The words that conditions look at. */
const words = (texts) =>
  texts.flatMap((text) => (text.match(/[a-z_]\w*(?=[. ]|$)/g) ?? []).filter((word) => signals.value.has(word)));

const conditions = (lesson) => [
  ...lesson.score.map((s) => s.once ?? s.never ?? s.at_end),
  ...(lesson.event ?? []).map((e) => e.when),
];

/** Values of a lesson, in counts. */
const raw = (set) =>
  Object.fromEntries(
    Object.entries(set ?? {}).map(([name, v]) => {
      const { about, bit } = place(name);
      return [name, bit ? Number(v) : Math.round(v * about.counts)];
    }),
  );

/** What the desk and the faults are before anybody has touched them. */
const untouched = () =>
  Object.fromEntries(
    [...signals.value.keys()]
      .filter((name) => /^(operator|fault)_/.test(name) && signals.value.get(name).direction === 'command')
      .map((name) => [name, 0]),
  );

/** The lesson's machine at power-up, and the desk as the lesson finds it. */
async function begin(lesson) {
  const { revision } = await get('info');
  const { cycles } = (await get('snapshot')).recording;
  if (!(await attempt('POST', 'parameters/preset', { name: MACHINE, revision }))) return;
  if (!(await attempt('POST', 'parameters/apply', { revision }))) return;
  // what is commanded before the machine is at power-up would be forgotten; its recording begins anew then
  for (let i = 0; i < TRIES && (await get('snapshot')).recording.cycles >= cycles; i++)
    await new Promise((wait) => setTimeout(wait, 100));
  if (info.value?.control?.by === 'nobody' && !(await attempt('POST', 'panel', { action: 'take' }))) return;
  const set = { ...untouched(), bus_delay: 1, ...raw(lesson.set), 'operator_request.reset_sets': 1 };
  if (!(await attempt('POST', 'commands', set))) return;
  play.value = {
    lesson,
    from: cycle.value + SETTLED,
    now: 0,
    hints: 0,
    earned: lesson.score.map((s) => Boolean(s.never)),
    events: (lesson.event ?? []).map(() => ({ since: null, done: false })),
    over: false,
    release: want(words(conditions(lesson))),
  };
  await attempt('POST', 'commands', { 'operator_request.reset_sets': 0 });
}

/** After every message of the stream: what has happened, what is earned. */
function look(at) {
  const p = play.value;
  if (!p || p.over || at < p.from) return;
  p.lesson.score.forEach((s, i) => {
    const so = holds(s.once ?? s.never ?? s.at_end);
    if (s.once) p.earned[i] ||= so;
    else if (s.never) p.earned[i] &&= !so;
    else p.earned[i] = so;
  });
  (p.lesson.event ?? []).forEach((event, i) => {
    const state = p.events[i];
    if (state.since === null && holds(event.when)) state.since = at;
    if (state.since !== null && !state.done && at - state.since >= (event.after ?? 0) / CYCLE_S) {
      state.done = true;
      attempt('POST', 'commands', raw(event.set));
    }
  });
  const now = (at - p.from) * CYCLE_S;
  if (now >= p.lesson.time) end(now);
  else if (Math.floor(now * 4) !== Math.floor(p.now * 4)) play.value = { ...p, now };
}

const total = (p) => p.lesson.score.reduce((sum, s, i) => sum + (p.earned[i] ? s.points : 0), 0);

function end(now) {
  const p = play.value;
  p.release();
  play.value = { ...p, now: now ?? p.now, over: true };
  points.value = { ...points.value, [p.lesson.name]: total(p) };
}

async function press(name) {
  const key = `operator_request.${name}`;
  if (!(await attempt('POST', 'commands', { [key]: 1 }))) return;
  setTimeout(() => attempt('POST', 'commands', { [key]: 0 }), PRESS);
}

/** A set-point of the desk; what is being written stays until it is sent. */
function SetPoint({ name, label, about }) {
  const [entry, set] = useState(null);
  const v = Number(entry);
  const bad = entry !== null && (entry.trim() === '' || !(v >= about.low && v <= about.high));
  const send = async () => {
    if (entry === null || bad) return;
    await attempt('POST', 'commands', { [name]: Math.round(v * about.counts) });
    set(null);
  };
  return html`<${Field} label=${label} unit=${about.unit} hint=${name}
    error=${bad ? `${about.low} to ${about.high} ${about.unit}` : ''}>${(a) => html`<input ...${a} type="number" step="any"
      value=${entry ?? (counts(name).value ?? 0) / about.counts} onInput=${(e) => set(e.target.value)} onBlur=${send}
      onKeyDown=${(e) => e.key === 'Enter' && send()} />`}<//>`;
}

function Desk() {
  const [panel] = useGet('panel', 700);
  const buttons = signals.value.get('operator_request')?.bits.filter((b) => !UNUSED.test(b.name)) ?? [];
  const by = info.value?.control?.by;
  return html`<section class="card"><h2>Operator's desk</h2>
    <p class="quiet">${by === 'plc' ? 'The PLC reads it.' : 'No PLC is connected: the operator panel follows it.'}
      ${by !== 'plc' && panel?.message ? html` <b>${sentence(panel.message)}</b>` : null}</p>
    <div class="buttons">${buttons.map((b) => html`<button type="button" key=${b.name} title=${b.description}
      class=${b.name === 'emergency_stop' ? 'stop' : ''}
      onClick=${() => press(b.name)}>${sentence(b.name.replace(/_/g, ' '))}</button>`)}</div>
    <div class="buttons">${FIELDS.map(([name, label]) => {
      const about = signals.value.get(name);
      return about
        ? html`<${SetPoint} key=${name} name=${name} label=${label} about=${about} />`
        : null;
    })}</div></section>`;
}

function Played({ p }) {
  const { lesson, over } = p;
  const more = p.hints < lesson.hints.length;
  return html`<div class="head"><h1>${lesson.title}</h1>
      <b>${total(p)} of 100 points</b>
      ${over ? null : html`<span>${span(Math.max(0, lesson.time - p.now))} left</span>`}
      ${over
        ? html`<button type="button" class="main" onClick=${() => (play.value = null)}>All lessons</button>`
        : html`<button type="button" onClick=${() => end()}>Finish</button>`}</div>
    <div class="lesson"><div class="stack">
        <section class="card"><p>${lesson.goal}</p>
          ${p.hints ? html`<ol class="hints">${lesson.hints.slice(0, p.hints).map((h) => html`<li key=${h}>${h}</li>`)}</ol>` : null}
          ${more && !over ? html`<div class="row"><button type="button" class="small"
            onClick=${() => (play.value = { ...p, hints: p.hints + 1 })}>A hint</button></div>` : null}</section>
        <${Desk} /></div>
      <div class="stack">
        <section class="card"><h2>Score</h2><table><tbody>${lesson.score.map((s, i) => html`<tr key=${s.what}><td>
          <span class=${p.earned[i] ? 'passed' : 'quiet'}><${Icon} name=${p.earned[i] ? 'check' : 'close'} />
            <span class="hidden">${p.earned[i] ? 'earned' : 'not earned'}</span></span> ${s.what}</td><td class="n">
              ${s.points}</td></tr>`)}</tbody></table></section>
        <section class="card"><h2>The winder</h2><dl class="facts">${SHOWN.map(([name, label]) => html`<div key=${name}>
          <dt>${label}</dt><dd><${Num} name=${name} /></dd></div>`)}</dl></section></div></div>`;
}

export default function Training() {
  const [lessons, set] = useState(null);
  const [busy, work] = useState(false);
  const p = play.value;
  useEffect(() => {
    fetch('lessons.json').then((a) => a.json()).then(set, () => set([]));
    // it goes on when another page is shown
    listeners.add(look);
  }, []);
  useLive(p ? [...FIELDS, ...SHOWN].map(([name]) => name) : []);
  if (p) return html`<${Played} p=${p} />`;
  const start = async (lesson) => {
    work(true);
    await begin(lesson);
    work(false);
  };
  return html`<div class="head"><h1>Training</h1></div>
    <p class="card active">A lesson begins with the ${MACHINE} machine at power-up. Whoever looks for what is wrong should not
      see what was put in: use the trainee view.</p>
    ${lessons ? null : html`<p class="card wait">Loading …</p>`}
    <div class="lessons">${(lessons ?? []).map((l) => html`<section class="card" key=${l.name}><div><h2>${l.title}</h2>
        <p class="quiet">${l.goal}</p></div>
      <div class="row"><button type="button" disabled=${busy} aria-label=${`Start: ${l.title}`}
        onClick=${() => start(l)}>Start</button>
        <span class="quiet">${span(l.time)}${points.value[l.name] === undefined ? '' : `, ${points.value[l.name]} of 100`}
          </span></div></section>`)}</div>`;
}
