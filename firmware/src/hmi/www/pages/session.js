/**
 * The session page: snapshot and restore, recording and replay, the event log.
 *
 * Not here: curves; they are on the trends page.
 */
import { html, useState, useEffect } from '../vendor/ui.js';
import { get, attempt, save, note } from '../api.js';
import { cycle, CYCLE_S } from '../live.js';
import { useGet, span, sentence } from '../parts.js';

const KINDS = ['mode', 'fault', 'refusal', 'autotune', 'replay', 'settings', 'audit'];
/** Events that the page keeps. */
const MOST = 400;

export default function Session() {
  const [snapshot, , again] = useGet('snapshot', 3000);
  const [events, setEvents] = useState([]);
  const [hidden, hide] = useState([]);
  useEffect(() => {
    let last = 0;
    let gone = false;
    const load = async () => {
      try {
        const { events: more } = await get(`events?after=${last}`);
        if (gone || !more.length) return;
        last = more[more.length - 1].n;
        setEvents((old) => [...old, ...more].slice(-MOST));
      } catch {
        // the next time
      }
    };
    load();
    const timer = setInterval(load, 1000);
    return () => ((gone = true), clearInterval(timer));
  }, []);
  const taken = snapshot?.taken_cycle;
  const has = taken !== null && taken !== undefined;
  const act = async (path, done) => (await attempt('POST', path, {}, done)) && again();
  const journal = async () => {
    try {
      save('run.csv', new Blob([await get('journal')], { type: 'text/csv' }));
    } catch (error) {
      note(error.message, true);
    }
  };
  const shown = events.filter((e) => !hidden.includes(e.kind)).reverse();
  return html`<div class="head"><h1>Session</h1></div>
    <div class="session">
      <section class="card"><h2>Snapshot</h2>
        <p>${has ? html`Taken at <b>${span(taken * CYCLE_S)}
          </b> of simulated time, cycle ${taken}.` : 'None has been taken.'}</p>
        <p class="quiet">The whole winder, its drives and their commands, as they are at one cycle. Restored, it goes on to the same bit.</p>
        <div class="row"><button type="button" class="main"
          onClick=${() => act('snapshot', 'Snapshot taken')}>Take a snapshot</button>
          <button type="button" disabled=${!has} onClick=${() => act('restore', 'Restored')}>Restore</button></div>
            </section>
      <section class="card"><h2>Recording</h2>
        <p>Every command with its cycle, since power-up or the snapshot. Now: cycle <b class="cycle">${cycle}</b>.</p>
        <p class="quiet">The file is what <code>cargo winder replay</code> reads.</p>
        <div class="row"><button type="button" onClick=${journal}>Save the recording</button>
          <button type="button" disabled=${!has}
            onClick=${() => act('replay', 'Replaying from the snapshot')}>Replay from the snapshot</button></div>
              </section>
      <section class="card events"><div class="head"><h2>Events</h2>
          <div class="row" role="group" aria-label="Kinds of events">
            ${KINDS.map((k) => html`<label key=${k} class="tick">
              <input type="checkbox" checked=${!hidden.includes(k)}
                onChange=${() => hide(hidden.includes(k) ? hidden.filter((o) => o !== k) : [...hidden, k])} /> ${k}
                  </label>`)}</div></div>
        <div class="scroll"><table><thead><tr><th class="n">Time</th><th>Kind</th><th>What</th></tr></thead><tbody>
          ${shown.map((e) => html`<tr key=${e.n}><td class="n mono">
            ${span(e.cycle * CYCLE_S)}.${String(e.cycle % 100).padStart(2, '0')}</td><td>
              ${e.kind === 'fault' ? html`<b class="failed">◆ fault</b>` : e.kind === 'refusal' ? html`<b
                class="warned">▲ refusal</b>` : e.kind}</td><td>${sentence(e.text)}</td></tr>`)}
          ${shown.length ? null : html`<tr><td colspan="3" class="quiet">Nothing has happened yet.</td></tr>`}</tbody>
            </table></div></section>
    </div>`;
}
