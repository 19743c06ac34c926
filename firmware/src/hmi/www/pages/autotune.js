/**
 * The auto-tune page: which loop, what it needs, how far it is, what it found.
 *
 * Not here: the tuning, which is the drives' own; it goes on and ends without this page.
 */
import { html, useState } from '../vendor/ui.js';
import { info, attempt } from '../api.js';
import { signals, counts, value, bit, code, figure } from '../live.js';
import { Icon, Num, useLive, useGet, sentence } from '../parts.js';

const LOOPS = [
  ['Drum speed', 'Both drums, without web. Turns them up and down and finds their inertia and friction.', 'kg·m²'],
  ['Unwind speed', 'The parent roll, without web. Finds its inertia and friction as it is now.', 'kg·m²'],
  ['Tension', 'The web, at thread speed. Finds how stiff the web path is.', 'N/m'],
];
const SIGNALS = [
  'autotune_loop',
  'autotune_step',
  'autotune_progress',
  'autotune_abort',
  'autotune_inertia',
  'autotune_friction',
  'autotune_stiffness',
  'autotune_gain_old',
  'autotune_gain_new',
  'autotune_time_old',
  'autotune_time_new',
];
const MODE = { ready: 1, thread: 2, tune: 10 };
const STEP = { done: 6, aborted: 7 };

/** What must be so, and whether it is. */
function needs(loop) {
  const status = (name) => bit('winder_status', name);
  const common = [
    ['No fault is latched', !status('fault')],
    ['All drives are in operation', status('drives_on')],
    ['A diameter preset has been taken over', status('preset_taken')],
  ];
  return loop === 2
    ? [
        ...common,
        ['The web is threaded', status('web_threaded')],
        ['Thread mode, the web under tension', counts('mode').value === MODE.thread && status('tension_detected')],
        ['The tension loop is closed', status('tension_control')],
      ]
    : [
        ...common,
        ['No web in the machine', !status('web_threaded')],
        ['The machine stands, drives ready', status('zero_speed') && counts('mode').value === MODE.ready],
      ];
}

function Gains() {
  const [gains] = useGet('gains', 3000);
  const list = gains?.loops ?? [];
  if (!list.length) return null;
  return html`<section class="card wide"><h2>Gains in use</h2><div class="scroll"><table><thead><tr><th>Loop</th>
    <th class="n">Gain</th><th class="n">Integral time</th><th>Source</th></tr></thead>
    <tbody>${list.map((l) => html`<tr key=${l.name}><td>${sentence(l.name)}</td><td class="n">
      ${figure(l.gain, l.gain < 10 ? 3 : 0)} ${l.unit ?? ''}</td><td class="n">${figure(l.time_s, 3)} s</td><td>
        ${l.source ?? (l.tuned ? 'auto-tune' : 'machine')}</td></tr>`)}</tbody></table></div></section>`;
}

export default function Autotune() {
  useLive(SIGNALS);
  const [loop, choose] = useState(0);
  const [panel, , again] = useGet('panel', 700);
  const by = info.value?.control?.by;
  const mode = counts('mode').value;
  const step = counts('autotune_step').value ?? 0;
  const running = mode === MODE.tune;
  const moving = ['preparing', 'threading', 'running', 'stopping'].includes(panel?.state);
  const steps = signals.value.get('autotune_step')?.codes ?? [];
  const of = running || step >= STEP.done ? (counts('autotune_loop').value ?? loop) : loop;
  const list = needs(loop);
  const missing = list.filter(([, met]) => !met).length;
  const act = async (action, more) => (await attempt('POST', 'panel', { action, ...more }), again());

  return html`<div class="head"><h1>Auto-tune</h1></div>
    <div class="tune">
      <section class="card" aria-label="Loop"><h2><span class="step" aria-hidden="true">1</span> Which loop</h2>
        <div class="choices" role="radiogroup" aria-label="Loop">
          ${LOOPS.map(([name, what], i) => html`<button type="button" key=${name} role="radio"
            aria-checked=${i === loop ? 'true' : 'false'} disabled=${running} onClick=${() => choose(i)}><b>${name}</b>
              <small>${what}</small></button>`)}</div>
      </section>
      <section class="card" aria-label="Conditions"><h2>
        <span class="step" aria-hidden="true">2</span> What it needs</h2>
        <ul class="needs">${list.map(([what, met]) => html`<li key=${what} class=${met ? 'met' : ''}>
          <${Icon} name=${met ? 'check' : 'close'} /><span>${what}<span class="hidden">${met ? ': met' : ': not met'}
            </span></span></li>`)}</ul>
        ${missing && !running ? html`<p class="quiet">
          ${by === 'panel' ? 'The panel brings the winder there when auto-tune starts.' : by === 'plc' ? 'The PLC brings the winder there.' : 'Take control, and the panel brings the winder there.'}</p>` : null}
      </section>
      <section class="card" aria-label="Tuning"><h2><span class="step" aria-hidden="true">3</span> Tune</h2>
        ${
          by === 'plc'
            ? html`<p class="banner">The PLC commands the winder; it starts auto-tune, too.</p>`
            : html`<div class="row">${
                by === 'panel'
                  ? running
                    ? html`<button type="button" class="stop" onClick=${() => act('stop')}>Cancel</button>`
                    : html`<button type="button" class="main" disabled=${moving}
                      onClick=${() => act('autotune', { loop })}>Start auto-tune</button>`
                  : html`<button type="button" class="main" onClick=${() => act('take')}>Take control</button>`
              }
            <span class="quiet">${by === 'panel' && moving ? 'Stop the web first.' : panel?.message || ''}</span></div>`
        }
        <progress max="100" value=${value('autotune_progress') || 0} aria-label="Progress of auto-tune" />
        <ol class="track">${steps.slice(1, STEP.done + 1).map((text, i) => html`<li key=${i}
          class=${step === STEP.aborted ? '' : step > i + 1 || step === STEP.done ? 'done' : step === i + 1 ? 'now' : ''}>${sentence(text)}</li>`)}</ol>
        ${step === STEP.aborted ? html`<p class="reason" role="alert">
          <b>Aborted:</b> ${code('autotune_abort')}. The old gains are in use.</p>` : null}
      </section>
      <section class="card" aria-label="Result"><h2><span class="step" aria-hidden="true">4</span> Result</h2>
        ${
          step === STEP.done
            ? html`<p class="tuned"><${Icon} name="check" /> ${LOOPS[of]?.[0]}: the new gains are in use.</p>
            <table><thead><tr><th /><th class="n">Before</th><th class="n">Found</th></tr></thead><tbody>
              <tr><td>Proportional gain</td><td class="n"><${Num} name="autotune_gain_old" /></td><td class="n">
                <${Num} name="autotune_gain_new" /> ${of === 2 ? 'N/N' : 'N·m·s/rad'}</td></tr>
              <tr><td>Integral time</td><td class="n"><${Num} name="autotune_time_old" /></td><td class="n">
                <${Num} name="autotune_time_new" /></td></tr>
              ${
                of === 2
                  ? html`<tr><td>Stiffness of the web path</td><td /><td class="n"><${Num} name="autotune_stiffness" />
                    </td></tr>`
                  : html`<tr><td>Inertia</td><td /><td class="n"><${Num} name="autotune_inertia" places=${1} /></td>
                    </tr><tr><td>Friction</td><td /><td class="n"><${Num} name="autotune_friction" /></td></tr>`
              }
            </tbody></table>`
            : html`<p
              class="quiet">What is found stands here: inertia and friction, or stiffness, and the gains before and after.</p>`
        }
      </section>
      <${Gains} />
    </div>`;
}
