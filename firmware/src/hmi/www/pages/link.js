/**
 * The link page: who is connected, how often it asks, what it wrote last, the raw words.
 *
 * Not here: the permission to connect, which is the board's.
 */
import { html, useState } from '../vendor/ui.js';
import { signals, counts, figure } from '../live.js';
import { Num, useGet, useLive } from '../parts.js';

/** Poll intervals: how many up to each edge, ms, and how many longer. */
function Histogram({ counts: list, edges }) {
  const most = Math.max(...list, 1);
  if (!list.some(Boolean)) return html`<span class="quiet">–</span>`;
  const text = list.map((n, i) => (i < edges.length ? `${n} up to ${edges[i]} ms` : `${n} longer`)).join(', ');
  return html`<span class="histogram" role="img" aria-label=${text} title=${text}>
    ${list.map((n, i) => html`<span key=${i} style=${{ height: n ? `${Math.max(8, (n / most) * 100)}%` : '2px' }} />`)}
      </span>`;
}

const age = (ms) =>
  ms === null || ms === undefined
    ? '–'
    : ms < 1000
      ? `${ms} ms`
      : ms < 60000
        ? `${(ms / 1000).toFixed(1)} s`
        : `${Math.floor(ms / 60000)} min`;

export default function Link() {
  const [link, error] = useGet('link', 1000);
  const [direction, choose] = useState('command');
  const own = [...signals.value.values()].filter((s) => s.direction === direction);
  useLive(own.map((s) => s.name));
  const writers = new Map((link?.registers ?? []).map((r) => [r.word, r]));
  const hex = (s) => {
    const raw = counts(s.name).value;
    if (raw === null) return '–';
    const wide = s.kind === 'u32' ? 8 : 4;
    return (raw < 0 ? raw + 65536 : raw).toString(16).toUpperCase().padStart(wide, '0');
  };
  return html`<div class="head"><h1>Link</h1></div>
    <div class="stack">
      <section class="card"><h2>Clients</h2>${error ? html`<p class="reason">${error}</p>` : null}
        <div class="scroll"><table><thead><tr><th>Address</th><th>Protocol</th><th>Control</th>
          <th class="n">Requests</th><th class="n">Exceptions</th><th class="n">Silent for</th><th>Poll intervals</th>
            </tr></thead>
        <tbody>${(link?.clients ?? []).map((c) => html`<tr key=${c.address + c.protocol}><td class="mono">${c.address}
          </td><td>${c.protocol}</td><td>${c.controls ? html`<b>commands</b>` : '–'}</td><td class="n">
            ${figure(c.requests, 0)}</td><td class="n">${c.exceptions ? html`<b class="warned">▲ ${c.exceptions}
              </b>` : '0'}</td><td class="n">${age(c.idle_ms)}</td><td>
                <${Histogram} counts=${c.poll_ms_histogram ?? []}
            edges=${link.poll_edges_ms ?? []} /></td></tr>`)}
          ${link && !link.clients.length ? html`<tr><td colspan="7" class="quiet">Nobody is connected.</td>
            </tr>` : null}</tbody></table></div></section>
      <section class="card"><div class="head"><h2>Registers</h2>
          <div class="pick" role="group" aria-label="Block">
            <button type="button" aria-pressed=${direction === 'command' ? 'true' : 'false'}
              onClick=${() => choose('command')}>Holding: commands</button>
                <button type="button" aria-pressed=${direction === 'feedback' ? 'true' : 'false'}
                  onClick=${() => choose('feedback')}>Input: feedback</button></div></div>
        <div class="scroll"><table class="registers"><thead><tr><th class="n">Word</th><th>Name</th>
          <th class="n">Hex</th><th class="n">Value</th>${direction === 'command' ? html`<th>Last writer</th>
            <th class="n">Since</th>` : html`<th>Meaning</th>`}</tr></thead>
        <tbody>${own.map((s) => {
          const w = writers.get(s.word);
          return html`<tr key=${s.name}><td class="n">${s.word}</td><td><code>${s.name}</code></td><td class="n mono">
            ${hex(s)}</td><td class="n">${s.kind === 'bits' ? '' : html`<${Num} name=${s.name} />`}</td>
              ${direction === 'command' ? html`<td class="mono">${w?.last_writer ?? '–'}</td><td class="n">
                ${age(w?.age_ms)}</td>` : html`<td class="quiet">${s.codes?.[counts(s.name).value] ?? s.description}
                  </td>`}</tr>`;
        })}</tbody></table></div></section>
    </div>`;
}
