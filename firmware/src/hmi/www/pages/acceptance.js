/**
 * The acceptance page: asks for a run, shows who does it, how far it is, and what it finds.
 *
 * Not here: the run. A program on a PC plays the operator; this page and the firmware only pass on what is asked and
 * what comes of it.
 */
import { html, useEffect, useState } from '../vendor/ui.js';
import { attempt } from '../api.js';
import { figure } from '../live.js';
import { Lamp, useGet } from '../parts.js';

const STATES = {
  none: 'No run has been asked for.',
  asked: 'Asked for; it begins when a runner takes it.',
  running: 'Running.',
  passed: 'Passed: every check has been looked at, and none has found anything.',
  failed: 'Not passed: there are findings.',
  stopped: 'Stopped before its end.',
};
/** The order of what is read: what was found first. */
const VERDICTS = [
  ['failed', '◆', 'Findings', 'failed'],
  ['not_seen', '○', 'Not seen', 'quiet'],
  ['passed', '✓', 'Passed', 'passed'],
];
/** So long a runner may take to be there, ms. */
const PATIENCE = 3000;

export default function Acceptance() {
  const [run, error, again] = useGet('acceptance', 1000);
  const [late, setLate] = useState(false);
  const state = run?.state;
  const alone = run && !run.runner;
  useEffect(() => {
    setLate(false);
    if (!alone || !(state === 'asked' || state === 'running')) return undefined;
    const timer = setTimeout(() => setLate(true), PATIENCE);
    return () => clearTimeout(timer);
  }, [alone, state, run?.request]);
  if (!run) return html`<div class="head"><h1>Acceptance</h1></div><p class="card wait">${error || 'Loading …'}</p>`;
  const busy = state === 'asked' || state === 'running';
  const ask = async (wish) => (await attempt('POST', 'acceptance', { run: wish })) && again();
  const of = (verdict) => run.checks.filter((c) => c.state === verdict);
  return html`<div class="head"><h1>Acceptance</h1>
      <${Lamp} on=${!alone} kind="ok">${run.runner ? `runner ${run.runner}` : 'no runner'}<//>
      ${busy && !(late && state === 'running')
        ? html`<button type="button" onClick=${() => ask(false)}>Take it back</button>`
        : html`<button type="button" class="main" onClick=${() => ask(true)}>Ask for a run</button>`}</div>
    <div class="stack">
      ${late
        ? html`<p class="card active some" role="status"><b>No runner is connected.</b> On a PC that reaches this address, start
          <code>WINDER_PASSWORD=… cargo winder accept --attend http://${location.host} ${location.hostname}:PORT</code>, with
          this page's password and the simulator's port of Modbus TCP: 502 on a board.</p>`
        : null}
      <section class="card accept"><h2>${run.request ? `Run ${run.request}` : 'Does your PLC do what a winder needs?'}</h2>
        <p role="status">${STATES[state] ?? state}${run.text ? html` <b>${run.text}</b>` : null}</p>
        ${run.request ? html`<progress max="1" value=${run.share} aria-label="Progress of the acceptance run" />` : null}
        ${run.checks.length ? html`<p class="quiet">${VERDICTS.map(([id, sign, title]) => html`<span key=${id}>
          ${sign} ${title}: ${figure(of(id).length, 0)}<//>`)}</p>` : null}
        <p class="quiet">The run plays the operator, puts faults in and takes them out again, and watches what the PLC
          does; it takes up to a quarter of an hour. The PLC must be connected and control the winder.</p></section>
      ${VERDICTS.map(([id, sign, title, kind]) => of(id).length
        ? html`<section class="card" key=${id}><h2>${title}</h2><table class="checks"><tbody>${of(id).map((c) => html`<tr
          key=${c.id}><td class=${kind}>${sign} <b>${c.id}</b></td><td>${c.text}</td></tr>`)}</tbody></table></section>`
        : null)}
    </div>`;
}
