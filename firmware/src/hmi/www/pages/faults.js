/**
 * The faults page: everything that a trainer can put in, by one click, for a time or until it is taken back.
 *
 * Not here: what the drives make of it; the alarm line and the mimic show that. A trainee's view has no such page.
 */
import { html, useState } from '../vendor/ui.js';
import { attempt } from '../api.js';
import { signals, counts, value, figure } from '../live.js';
import { Icon, Field, useGet, useLive, sentence, span } from '../parts.js';

const WORDS = [
  'fault_machine',
  'fault_web_break',
  'fault_drum_wear',
  'fault_eccentricity_uw',
  'fault_sensors',
  'fault_wrap_angle',
  'fault_load_cell_drift',
  'fault_drives',
  'fault_preset',
  'bus_delay',
];
const GROUPS = [
  ['Web and rolls', ['fault_web_break', 'fault_drum_wear', 'fault_eccentricity_uw']],
  ['Brakes and paper', ['fault_machine']],
  ['Sensors', ['fault_sensors', 'fault_wrap_angle', 'fault_load_cell_drift']],
  ['Drives', ['fault_drives', 'fault_preset', 'bus_delay']],
];
/** What a single click puts in, in counts. */
const CLICK = {
  fault_web_break: 1,
  fault_drum_wear: 400,
  fault_eccentricity_uw: 20,
  fault_wrap_angle: 50,
  fault_load_cell_drift: 60,
  fault_preset: -33,
  bus_delay: 5,
};
/** What a sound machine has. */
const SOUND = { bus_delay: 1 };
const TITLE = {
  fault_web_break: 'Web break',
  fault_drum_wear: 'Worn drums',
  fault_eccentricity_uw: 'Eccentric parent roll',
  fault_wrap_angle: 'Wrong wrap angle',
  fault_load_cell_drift: 'Load cells drift',
  fault_preset: 'Wrong diameter preset',
  bus_delay: 'Slow bus',
};

export default function Faults() {
  useLive(WORDS);
  const [time, setTime] = useState('0');
  const [entries, setEntries] = useState({});
  // the simulator counts, whether a page looks on or not
  const [timed, , again] = useGet('faults', 500);
  const put = async (key, on, off) => {
    const seconds = on === off ? 0 : Number(time);
    const body = seconds ? { [key]: on, for_s: seconds } : { [key]: on };
    if (await attempt('POST', 'commands', body)) again();
  };
  const rest = (key) => {
    const one = timed?.timed.find((fault) => fault.name === key);
    return one ? html`<em title="ends by itself">${span(Math.ceil(one.left_s))}</em>` : null;
  };
  const active = WORDS.filter((name) => signals.value.has(name)).flatMap((name) => {
    const about = signals.value.get(name);
    const raw = counts(name).value;
    if (raw === null) return [];
    if (about.kind === 'bits') return about.bits.filter((b) => (raw >> b.number) & 1).map((b) => b.description);
    return raw === (SOUND[name] ?? 0) ? [] : [`${TITLE[name]}: ${figure(value(name), 0)} ${about.unit}`];
  });
  const clear = () => {
    attempt(
      'POST',
      'commands',
      Object.fromEntries(WORDS.map((name) => [name, SOUND[name] ?? 0])),
      'The machine is sound',
    );
  };

  const one = (name) => {
    const about = signals.value.get(name);
    if (!about) return null;
    const raw = counts(name).value ?? 0;
    if (about.kind === 'bits')
      return about.bits.map((b) => {
        const on = (raw >> b.number) & 1;
        const key = `${name}.${b.name}`;
        return html`<li key=${key}><button type="button" class=${`put ${on ? 'in' : ''}`}
          aria-pressed=${on ? 'true' : 'false'} onClick=${() => put(key, on ? 0 : 1, 0)}>
          <${Icon} name=${on ? 'close' : 'faults'} /><span><b>${sentence(b.description)}</b><code>${b.name}</code>
            </span>${rest(key)}</button></li>`;
      });
    const sound = SOUND[name] ?? 0;
    const on = raw !== sound && counts(name).value !== null;
    const entry = entries[name] ?? String(CLICK[name] / about.counts);
    const n = Number(entry);
    const bad =
      entry.trim() === '' || !Number.isFinite(n)
        ? 'a number, please'
        : n < about.low || n > about.high
          ? `${about.low} to ${about.high} ${about.unit}`
          : '';
    return html`<li key=${name} class="valued">
      <button type="button" class=${`put ${on ? 'in' : ''}`} aria-pressed=${on ? 'true' : 'false'}
        disabled=${!on && bad} onClick=${() => put(name, on ? sound : Math.round(n * about.counts), sound)}>
        <${Icon} name=${on ? 'close' : 'faults'} /><span><b>
          ${TITLE[name] ?? name}${on ? `: ${figure(value(name), about.counts > 1 ? 1 : 0)} ${about.unit}` : ''}</b>
            <small>${about.description}</small></span>${rest(name)}</button>
      <${Field} label=${name === 'fault_web_break' ? 'Span' : name === 'bus_delay' ? 'Cycles' : 'Value'}
        unit=${about.unit} error=${bad}>
          ${(a) => html`<input ...${a} type="number" step="any" min=${about.low} max=${about.high} value=${entry}
            onInput=${(e) => setEntries({ ...entries, [name]: e.target.value })} />`}<//></li>`;
  };

  return html`<div class="head"><h1>Faults</h1>
      <${Field} label="A click puts in">
        ${(a) => html`<select ...${a} value=${time} onChange=${(e) => setTime(e.target.value)}>
          <option value="0">until taken back</option>
            ${[1, 5, 10, 30, 60].map((s) => html`<option key=${s} value=${s}>for ${s} s</option>`)}</select>`}<//>
      <button type="button" disabled=${!active.length} onClick=${clear}>All sound</button></div>
    <p class=${`card active ${active.length ? 'some' : ''}`} aria-live="polite">
      ${active.length ? html`<b>Put in:</b> ${active.join('; ')}` : 'The machine is sound.'}</p>
    <div class="faults">${GROUPS.map(([title, names]) => html`<section class="card" key=${title}><h2>${title}</h2><ul>
      ${names.map(one)}</ul></section>`)}</div>`;
}
