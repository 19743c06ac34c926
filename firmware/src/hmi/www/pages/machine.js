/**
 * The machine page: mimic, key values, sections, operator panel.
 *
 * Not here: the sequence of the panel, which the firmware has; a closed page stops nothing.
 */
import { html, useState, useEffect, signal } from '../vendor/ui.js';
import { info, attempt, get } from '../api.js';
import { signals, counts, value, bit, figure, history, listeners, CYCLE_S } from '../live.js';
import { Num, Bar, Lamp, Field, Switch, SECTIONS, useGet, useLive, sentence, span } from '../parts.js';
import { Mimic, geometry } from '../mimic.js';

/** The machine's parameters by name; of which revision. */
const machine = signal({ revision: null, values: new Map() });

async function load(revision) {
  try {
    const answer = await get('parameters');
    const values = new Map(answer.parts.flatMap((part) => part.parameters).map((p) => [p.name, p.value]));
    machine.value = { revision, values };
  } catch {
    // the mimic keeps the machine that it has
  }
}

/** The last minute of a value. */
function Spark({ name, low, high }) {
  const [d, set] = useState('');
  useEffect(() => {
    let last = 0;
    const draw = (at) => {
      if (at - last < 25 && at > last) return;
      last = at;
      const [cycles, column] = history.rows([name], at - 60 / CYCLE_S, at);
      const step = Math.max(1, Math.floor(cycles.length / 120));
      let path = '';
      for (let i = 0; i < cycles.length; i += step) {
        if (column[i] === null) continue;
        const x = 120 - (at - cycles[i]) * CYCLE_S * 2;
        const y = 30 - (28 * (column[i] - low)) / (high - low);
        path += `${path ? 'L' : 'M'}${x.toFixed(1)} ${Math.min(31, Math.max(1, y)).toFixed(1)}`;
      }
      set(path);
    };
    listeners.add(draw);
    return () => listeners.delete(draw);
  }, [name, low, high]);
  return html`<svg class="spark" viewBox="0 0 120 32" preserveAspectRatio="none" aria-hidden="true"><path d=${d} />
    </svg>`;
}

function Tile({ label, name, reference, low, high, at, children, kind }) {
  return html`<article class=${`tile ${kind || ''}`}>
    <h3>${label}</h3>
    <p class="value"><${Num} name=${name} places=${0} /></p>
    ${at ? html`<${Spark} name=${name} low=${low * at} high=${high * at} />` : null}
    <p class="under">${reference ? html`set <${Num} name=${reference} places=${0} />` : children}</p>
  </article>`;
}

function Tiles({ of }) {
  const t = value('tension');
  const r = value('tension_ref');
  const odd =
    bit('winder_status', 'web_threaded') && r > 1 && Math.abs(t / r - 1) > 0.15 ? (t > r ? 'high' : 'low') : '';
  const fast = (of.get('operation.max_speed_m_s') ?? 41.7) * 60;
  const tight = (of.get('operation.tension_n_m') ?? 350) * 1.6;
  return html`<section class="tiles" aria-label="Key values">
    <${Tile} label="Web speed" name="v_web" reference="v_ref" low=${0} high=${fast} at=${10} />
    <${Tile} label="Web tension" name="tension" reference="tension_ref" low=${0} high=${tight} at=${1} kind=${odd} />
    <${Tile} label="Shipping roll" name="d_wu" low=${0} high=${2200 * (of.get('shipping_roll.full_radius_m') ?? 0.6)}
      at=${10}><${Num} name="length_wu" places=${0} /> wound<//>
    <${Tile} label="Parent roll" name="d_uw" low=${0} high=${2100 * (of.get('parent_roll.full_radius_m') ?? 1.5)}
      at=${10}>estimated by the drive<//>
  </section>`;
}

/** What a drive is, of its status word. */
function drive(section) {
  const zsw = `zsw1_${section}`;
  if (bit(zsw, 'fault')) return ['fault', 'bad'];
  if (bit(zsw, 'operation_enabled')) return ['in operation', 'on'];
  if (bit(zsw, 'ready_to_operate')) return ['switched on', 'half'];
  if (bit(zsw, 'ready_to_switch_on')) return ['ready', ''];
  return ['off', ''];
}

function Sections() {
  return html`<section class="sections" aria-label="Drives">
    ${SECTIONS.map(([id, name]) => {
      const [word, kind] = drive(id);
      const closed = bit('winder_status', `brake_${id}`);
      return html`<article class="card section" key=${id}>
        <h3>${name}<${Lamp} on=${kind} kind=${kind}>${word}<//></h3>
        <dl>
          <div><dt>Speed</dt><dd><${Num} name=${`n_${id}`} places=${1} /></dd></div>
          <div><dt>Torque</dt><dd><${Bar} name=${`torque_${id}`} low=${-150} high=${150}
            label="torque from −150 to 150 %" /><${Num} name=${`torque_${id}`} places=${0} /></dd></div>
          <div><dt>Power</dt><dd><${Num} name=${`power_${id}`} places=${0} /></dd></div>
          ${
            id === 'rr'
              ? html`<div><dt>Load</dt><dd>${bit('winder_status', 'rider_down') ? '' : 'lifted · '}
                <${Num} name="rider_load" places=${0} /></dd></div>`
              : html`<div><dt>Brake</dt><dd><span class=${`brake-word ${closed ? 'closed' : ''}`}>
                ${closed ? 'closed' : 'open'}</span></dd></div>`
          }
        </dl>
      </article>`;
    })}
  </section>`;
}

const STEPS = [
  ['prepare', 'Prepare', 'New core and parent roll, diameter preset, drives on, web led through'],
  ['thread', 'Thread', 'Slack is taken up at thread speed, then stall tension'],
  ['run', 'Run', 'To the set speed; stops by itself at the goal'],
  ['stop', 'Stop', 'Normal stop; the web stays under stall tension'],
];
/** The step that each state of the sequence belongs to, and what can be done next. */
const STATE = {
  off: [-1, ['prepare']],
  preparing: [0, ['stop']],
  ready: [0, ['prepare', 'thread']],
  threading: [1, ['stop']],
  threaded: [1, ['run', 'thread', 'stop']],
  running: [2, ['stop', 'run']],
  stopping: [3, []],
  tuning: [-1, ['stop']],
};

/** Set-points that a set rarely needs changed. */
const MORE = [
  ['tension_set', 'Web tension'],
  ['v_thread_set', 'Thread speed'],
  ['rider_load_set', 'Rider load'],
];

/** A set-point of the panel: what stands in the image until somebody writes another one. */
function Setpoint({ name, label, disabled }) {
  const [entry, set] = useState(null);
  const about = signals.value.get(name);
  if (!about) return null;
  const n = Number(entry);
  const bad =
    entry === null
      ? ''
      : entry.trim() === '' || !Number.isFinite(n)
        ? 'a number, please'
        : n < about.low || n > about.high
          ? `${about.low} to ${about.high} ${about.unit}`
          : '';
  const commit = async () => {
    if (entry === null || bad) return;
    await attempt('POST', 'commands', { [name]: Math.round(n * about.counts) });
    set(null);
  };
  const now = value(name);
  return html`<${Field} label=${label} unit=${about.unit} error=${bad}>${(
    a,
  ) => html`<input ...${a} type="number" step="any" disabled=${disabled}
    value=${entry ?? (Number.isFinite(now) ? now : '')} onInput=${(e) => set(e.target.value)} onBlur=${commit}
      onKeyDown=${(e) => e.key === 'Enter' && commit()} />`}<//>`;
}

function More({ mine }) {
  useLive([...MORE.map(([name]) => name), 'winder_command_2']);
  const write = (name, on) => attempt('POST', 'commands', { [`winder_command_2.${name}`]: on ? 1 : 0 });
  return html`<details class="more"><summary>Tension, rider roll</summary>
    <div class="entries">${MORE.map(([name, label]) => html`<${Setpoint} key=${name} name=${name} label=${label}
      disabled=${!mine} />`)}</div>
    <${Switch} on=${bit('winder_command_2', 'rider_up')} disabled=${!mine} label="Rider roll lifted"
      onchange=${(on) => write('rider_up', on)} />
    <${Switch} on=${!bit('winder_command_2', 'tension_control_off')} disabled=${!mine} label="Tension loop closed"
      onchange=${(on) => write('tension_control_off', !on)} />
  </details>`;
}

function Panel({ of }) {
  const [panel, , again] = useGet('panel', 500);
  const [goal, setGoal] = useState('diameter');
  const [typed, setEntry] = useState({});
  const by = info.value?.control?.by;
  const state = panel?.state ?? 'off';
  const [at, next] = STATE[state] ?? [-1, ['stop']];
  const mine = by === 'panel';
  const standing = bit('winder_status', 'zero_speed');

  const limits = {
    speed: [0, (of.get('operation.max_speed_m_s') ?? 41.667) * 60, 'm/min'],
    diameter: [
      2000 * (of.get('shipping_roll.core_radius_m') ?? 0.05),
      2000 * (of.get('shipping_roll.full_radius_m') ?? 0.625),
      'mm',
    ],
    length: [1, 100000, 'm'],
  };
  // a set that takes a few minutes, on a machine of this size
  const usual = (key, share) => String(Math.round(limits[key][1] * share));
  const entry = { speed: usual('speed', 0.48), diameter: usual('diameter', 0.32), length: '1000', ...typed };
  const wrong = (key) => {
    const [low, high, unit] = limits[key];
    const n = Number(entry[key]);
    if (entry[key].trim() === '' || !Number.isFinite(n)) return 'a number, please';
    if (n < low) return `at least ${figure(low, 0)} ${unit}`;
    if (n > high) return `at most ${figure(high, 0)} ${unit}`;
    return '';
  };
  const act = async (action, more = {}) => {
    await attempt('POST', 'panel', { action, ...more });
    again();
  };
  const press = async (action) => {
    if (action !== 'run') return act(action);
    const more = { v_set_m_min: Number(entry.speed) };
    if (goal === 'diameter') more.diameter_mm = Number(entry.diameter);
    if (goal === 'length') more.length_m = Number(entry.length);
    return act('run', more);
  };
  const input = (key, label) =>
    html`<${Field} label=${label} unit=${limits[key][2]} error=${wrong(key)}>${(a) => html`<input ...${a} type="number"
    inputmode="decimal" min=${limits[key][0]} max=${Math.round(limits[key][1])} step="any" value=${entry[key]}
      onInput=${(e) => setEntry({ ...typed, [key]: e.target.value })} />`}<//>`;
  const invalid = wrong('speed') || (goal !== 'none' && wrong(goal));

  const target = panel?.goal ?? {};
  const done = target.diameter_mm
    ? progress(of, target.diameter_mm)
    : target.length_m
      ? value('length_wu') / target.length_m
      : null;
  return html`<section class="card panel" aria-label="Operator panel">
    <h2>Operator panel</h2>
    ${
      by === 'plc'
        ? html`<p class="banner">
          <b>The PLC commands.</b> ${info.value.control.plc ? `It writes from ${info.value.control.plc}.` : ''} This panel waits until it is silent.</p>`
        : mine
          ? html`<p class="banner mine"><b>This page commands.</b> <button type="button" class="plain text"
            onClick=${() => act('release')}>Release</button></p>`
          : html`<p class="banner">No PLC commands the winder. <button type="button" class="main"
            onClick=${() => act('take')}>Take control</button></p>`
    }
    <div class="entries">
      ${input('speed', 'Web speed')}
      <${Field} label="Stop at">${(a) => html`<select ...${a} value=${goal} onChange=${(e) => setGoal(e.target.value)}>
        <option value="diameter">diameter</option><option value="length">length</option>
          <option value="none">my command</option></select>`}<//>
      ${goal === 'none' ? null : input(goal, goal === 'diameter' ? 'Diameter' : 'Length')}
    </div>
    <ol class="steps">
      ${STEPS.map(([action, name, what], i) => {
        const can = mine && next.includes(action) && !(action === 'run' && invalid);
        return html`<li class=${i < at ? 'done' : i === at ? 'now' : ''} key=${action}>
          <button type="button" disabled=${!can} class=${can && next[0] === action ? 'main' : ''}
            onClick=${() => press(action)}>
            <span class="step" aria-hidden="true">${i + 1}</span><span><b>${name}</b><small>${what}</small></span>
              </button></li>`;
      })}
    </ol>
    ${done !== null && at === 2 ? html`<p class="goal">
      <progress max="1" value=${Math.min(1, done || 0)} aria-label="The set" /><span>
        ${figure(100 * Math.min(1, done || 0), 0)} % of ${target.diameter_mm ? `${figure(target.diameter_mm, 0)} mm` : `${figure(target.length_m, 0)} m`}${left(of, target, done)}</span></p>` : null}
    <${More} mine=${mine} />
    <p class="message" aria-live="polite">${sentence(panel?.message || '')}</p>
    <div class="row spread">
      <button type="button" disabled=${!mine || !standing} onClick=${() => act('new_set')}>New set</button>
      <button type="button" class="stop" disabled=${!mine}
        onClick=${() => act('emergency_stop')}>Emergency stop</button>
    </div>
  </section>`;
}

/** Share of the paper that is on the roll: by area, not by diameter. */
function progress(of, diameter_mm) {
  const core = 2000 * (of.get('shipping_roll.core_radius_m') ?? 0.05);
  const d = value('d_wu');
  return (d * d - core * core) / (diameter_mm * diameter_mm - core * core);
}

function left(of, target, done) {
  const v = value('v_web') / 60;
  if (!(v > 1) || !(done < 1)) return '';
  const core = 2 * (of.get('shipping_roll.core_radius_m') ?? 0.05);
  const caliper = of.get('web.caliper_m') ?? 65e-6;
  const all = target.length_m || (Math.PI * ((target.diameter_mm / 1000) ** 2 - core * core)) / (4 * caliper);
  return `, ${span((all * (1 - done)) / v)} left`;
}

/** The page. */
export function Machine() {
  const revision = info.value?.revision;
  useEffect(() => {
    if (revision !== undefined && revision !== machine.value.revision) load(revision);
  }, [revision]);
  const of = machine.value.values;
  return html`<h1 class="hidden">Machine</h1>
    <div class="machine">
      <section class="card mimic" aria-label="Mimic"><${Mimic} machine=${geometry(of)} />
        <p class="caption">${info.value ? html`<b>${info.value.machine}
          </b> on ${info.value.board}, simulated time ${span(counts('mode').value === null ? NaN : info.value.cycle * CYCLE_S)}` : ''}</p></section>
      <${Panel} of=${of} />
      <${Tiles} of=${of} />
      <${Sections} />
    </div>`;
}
