/**
 * The drive page: control and status words bit by bit, set-points, feedback, gains.
 *
 * Not here: changing any of it. The PLC commands, or the operator panel.
 */
import { html, useState } from '../vendor/ui.js';
import { signals, figure } from '../live.js';
import { Bits, Num, useLive, useGet, SECTIONS, sentence } from '../parts.js';

const TABS = [['winder', 'Winder'], ...SECTIONS];
/** Words that other pages show. */
const ELSEWHERE = /^(fault_|bus_delay|autotune_|plant_|drive_|logic_|trajectory)/;

function Values({ list, title }) {
  return list.length
    ? html`<section class="card"><h2>${title}</h2><div class="scroll"><table class="values"><tbody>${list.map(
        (s) =>
          html`<tr key=${s.name}><td><code>${s.name}</code><small>${s.description}</small></td><td class="n">
            <${Num} name=${s.name} /></td></tr>`,
      )}</tbody></table></div></section>`
    : null;
}

export default function Drive() {
  const [tab, choose] = useState('winder');
  const [gains] = useGet('gains', 3000);
  const own = [...signals.value.values()].filter((s) => s.section === tab && !ELSEWHERE.test(s.name));
  useLive(own.map((s) => s.name));
  const words = own.filter((s) => s.kind === 'bits');
  const numbers = (direction) => own.filter((s) => s.direction === direction && s.kind !== 'bits' && s.kind !== 'code');
  return html`<div class="head"><h1>Drive</h1>
      <div class="pick" role="group" aria-label="Section">
        ${TABS.map(([id, name]) => html`<button type="button" key=${id} aria-pressed=${id === tab ? 'true' : 'false'}
          onClick=${() => choose(id)}>${name}</button>`)}</div></div>
    <div class="drive">
      <div class="words">
        ${words.map((s) => html`<section class="card" key=${s.name}><p class="quiet">${s.description}</p>
          <${Bits} name=${s.name} /></section>`)}
      </div>
      <div class="stack">
        ${
          gains?.loops?.length && tab === 'winder'
            ? html`<section class="card"><h2>Regulators</h2><div class="scroll"><table class="values"><thead><tr><th>Loop</th>
              <th class="n">Gain</th><th class="n">Integral time</th><th>From</th></tr></thead><tbody>
              ${gains.loops.map((l) => html`<tr key=${l.name}><td>${sentence(l.name)}</td><td class="n"><b>
                ${figure(l.gain ?? NaN, l.gain < 10 ? 3 : 0)}</b> ${l.unit}</td><td class="n"><b>
                  ${figure(l.time_s ?? NaN, 3)}</b> s</td><td>${l.source}</td></tr>`)}</tbody></table></div>
              <p class="quiet">At the present diameters.</p></section>`
            : null
        }
        <${Values} title="Set-points" list=${numbers('command')} />
        <${Values} title="Feedback" list=${numbers('feedback')} />
      </div>
    </div>`;
}
