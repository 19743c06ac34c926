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
/** What there is a limited number of. */
const PLACES = { browsers: 'Connections of browsers', modbus: 'Modbus clients', recording: 'Recorded commands' };
const us = (n) => (n === null || n === undefined ? '–' : `${figure(n, 0)} µs`);

export default function Health() {
  const [health, error, again] = useGet('health', 1500);
  if (!health) return html`<div class="head"><h1>Health</h1></div><p class="card wait">${error || 'Loading …'}</p>`;
  const { memory } = health;
  const late = health.tasks.reduce((sum, t) => sum + (t.overruns || 0), 0);
  return html`<div class="head"><h1>Health</h1>
      <${Lamp} on=${true} kind=${late ? 'bad' : 'ok'}>${late ? `${late} late` : 'every task on time'}<//>
      <button type="button"
        onClick=${async () => (await attempt('POST', 'health/reset', {}, 'Worst times forgotten')) && again()}>Forget the worst times</button></div>
    <div class="stack">
      <section class="tasks">${health.tasks.map((t) => {
        if (t.longest_us === null)
          return html`<article class="card" key=${t.name}><h2>${sentence(t.name)} <small>
            every ${figure(t.period_us / 1000, 0)} ms, behind the timed tasks</small></h2>
            <p class="large">${figure(t.overruns, 0)}<small>cycles without their turn</small></p></article>`;
        const share = t.longest_us / t.period_us;
        return html`<article class="card" key=${t.name}><h2>${sentence(t.name)} <small>
          ${t.period_us ? `every ${figure(t.period_us / 1000, 0)} ms` : 'in the background'}</small></h2>
          <p class="large">${figure(100 * share, 1)} %<small>of its period at worst</small>
            </p>
          <progress max="1" value=${share} aria-label=${`Worst time of ${t.name}, of its period`} />
          <dl class="facts"><div><dt>Longest</dt><dd>${us(t.longest_us)}</dd></div><div><dt>Latest start</dt><dd>
            ${us(t.jitter_us)}</dd></div><div><dt>Overruns</dt><dd>
              ${t.overruns ? html`<b class="failed">◆ ${figure(t.overruns, 0)}</b>` : '0'}</dd></div></dl></article>`;
      })}</section>
      <div class="two">
        <section class="card"><h2>Simulator</h2><dl class="facts"><div><dt>Version</dt><dd>${health.version}</dd></div>
          <div><dt>Board</dt><dd>${health.board}</dd></div><div><dt>Up for</dt><dd>${span(health.uptime_s)}</dd></div>
            <div><dt>Last reset</dt><dd>${health.reset_reason}</dd></div></dl></section>
        <section class="card"><h2>Memory</h2><dl class="facts">
          ${memory ? html`<div><dt>Static variables</dt><dd>${bytes(memory.static_ram)}</dd></div>
            <div><dt>Heap</dt><dd>none</dd></div>` : null}
          ${[
            ...(memory ? [['Stack, at its deepest', memory.stack_used_at_most, memory.stack, bytes]] : []),
            ...(health.places ?? []).map((p) => [PLACES[p.name] ?? p.name, p.used, p.of, (n) => figure(n, 0)]),
          ].map(([name, used, of, show]) => html`<div key=${name}><dt>${name}</dt><dd>${show(used)} of ${show(of)}</dd></div>
            <progress max=${of} value=${used} aria-label=${name} />`)}</dl></section>
      </div>
    </div>`;
}
