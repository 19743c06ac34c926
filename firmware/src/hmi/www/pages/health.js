/**
 * The health page: whether the simulator keeps its time, and what it is.
 *
 * Not here: the winder's own warnings and faults.
 */
import { html } from '../vendor/ui.js';
import { attempt } from '../api.js';
import { figure } from '../live.js';
import { Lamp, useGet, span, sentence } from '../parts.js';

/** Memory in the unit that fits. */
const bytes = (n) =>
  n >= 1 << 20 ? `${figure(n / (1 << 20), 1)} MiB` : n >= 1024 ? `${figure(n / 1024, 0)} KiB` : `${n} B`;
const us = (n) => (n === null || n === undefined ? '–' : `${figure(n, 0)} µs`);

export default function Health() {
  const [health, error, again] = useGet('health', 1500);
  if (!health) return html`<div class="head"><h1>Health</h1></div><p class="card wait">${error || 'Loading …'}</p>`;
  const late = health.tasks.reduce((sum, t) => sum + (t.overruns || 0), 0);
  return html`<div class="head"><h1>Health</h1>
      <${Lamp} on=${true} kind=${late ? 'bad' : 'ok'}>${late ? `${late} late` : 'every task on time'}<//>
      <button type="button"
        onClick=${async () => (await attempt('POST', 'health/reset', {}, 'Worst times forgotten')) && again()}>Forget the worst times</button></div>
    <div class="stack">
      <section class="tasks">${health.tasks.map((t) => {
        const share = t.longest_us && t.period_us ? t.longest_us / t.period_us : null;
        return html`<article class="card" key=${t.name}><h2>${sentence(t.name)} <small>
          ${t.period_us ? `every ${figure(t.period_us / 1000, 0)} ms` : 'in the background'}</small></h2>
          <p class="large">${share === null ? '–' : `${figure(100 * share, 1)} %`}<small>of its period at worst</small>
            </p>
          <progress max="1" value=${share ?? 0} aria-label=${`Worst time of ${t.name}, of its period`} />
          <dl class="facts"><div><dt>Longest</dt><dd>${us(t.longest_us)}</dd></div><div><dt>Latest start</dt><dd>
            ${us(t.jitter_us)}</dd></div><div><dt>Overruns</dt><dd>
              ${t.overruns ? html`<b class="failed">◆ ${figure(t.overruns, 0)}</b>` : '0'}</dd></div></dl></article>`;
      })}</section>
      <div class="two">
        <section class="card"><h2>Simulator</h2><dl class="facts"><div><dt>Version</dt><dd>${health.version}</dd></div>
          <div><dt>Board</dt><dd>${health.board}</dd></div><div><dt>Up for</dt><dd>${span(health.uptime_s)}</dd></div>
            <div><dt>Last reset</dt><dd>${health.reset_reason}</dd></div></dl></section>
        ${health.memory
          ? html`<section class="card"><h2>Memory</h2><dl class="facts">
          ${Object.entries(health.memory ?? {}).map(([name, n]) => html`<div key=${name}><dt>
            ${sentence(name.replace(/_/g, ' ').replace(/\bram\b/, 'RAM'))}</dt><dd>
              ${typeof n === 'number' ? bytes(n) : n === null ? '–' : String(n)}</dd></div>`)}</dl></section>`
          : null}
      </div>
    </div>`;
}
