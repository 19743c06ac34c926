/**
 * What the board remembers without power: a part of the parameters page.
 *
 * Not here: the machine, which is stored when it is applied; the limits, which the simulator checks and tells.
 */
import { html, useState } from '../vendor/ui.js';
import { write, attempt, note, detail } from '../api.js';
import { figure } from '../live.js';
import { Dialog, Field, Lamp, sentence } from '../parts.js';

/** Where the settings stand: the lamp's kind, in a few words, and in a sentence. */
const STATES = {
  stored: ['ok', 'stored', 'Machine, network and serial line are in the flash, and there at the next start.'],
  empty: ['on', 'defaults', 'Nothing is in the flash: the next start has the defaults. What is changed is stored.'],
  waiting: ['half', 'not stored yet', 'Being written; after many changes the flash rests for up to a quarter of an hour.'],
  failed: ['bad', 'not stored', 'The flash did not take them; the next try is within a minute.'],
  undecided: ['bad', 'not stored', 'Nothing is stored until you decide.'],
  nowhere: ['on', 'until the power goes', 'This board has no place to store anything.'],
};

/** Whether what is in use is there at the next start. */
export const Kept = ({ settings }) => {
  const [kind, words] = STATES[settings?.state] ?? [];
  return words ? html`<span aria-live="polite"><${Lamp} on=${true} kind=${kind}>${words}<//></span>` : null;
};

const line = (s) => `${figure(s.baud, 0)} Bd, ${s.parity === 'none' ? 'no' : s.parity} parity, station ${s.address}`;
const host = (n) => (n.dhcp ? 'by DHCP' : n.address + (n.gateway ? ` over ${n.gateway}` : ''));

export default function Board({ settings, again }) {
  const [entry, setEntry] = useState(null);
  const [errors, setErrors] = useState({});
  const [asking, ask] = useState(false);
  if (!settings) return html`<p class="card wait">Loading …</p>`;

  const { network, serial } = settings;
  const next = {
    dhcp: network.next.dhcp ? 'dhcp' : 'fixed',
    address: network.next.address ?? '',
    gateway: network.next.gateway ?? '',
    baud: serial.next.baud,
    parity: serial.next.parity,
    station: serial.next.address,
  };
  const shown = entry ?? next;
  const dirty = Object.keys(next).some((key) => String(shown[key]) !== String(next[key]));
  const type = (key) => (e) => setEntry({ ...shown, [key]: e.target.value });
  const input = (key, name, label, more = {}) =>
    html`<${Field} label=${label} unit=${more.unit} error=${errors[name]} hint=${more.hint}>${(a) => html`<input ...${a}
      type="text" inputmode=${more.mode} value=${shown[key]} disabled=${more.disabled} onInput=${type(key)} />`}<//>`;
  const select = (key, name, label, choices) =>
    html`<${Field} label=${label} error=${errors[name]}>${(a) => html`<select ...${a} value=${shown[key]}
      onChange=${type(key)}>${choices.map(([value, words]) => html`<option key=${value} value=${value}>${words}</option>`)}
        </select>`}<//>`;
  const put = async () => {
    const dhcp = shown.dhcp === 'dhcp';
    const wish = {
      network: dhcp ? { dhcp } : { dhcp, address: shown.address.trim(), gateway: shown.gateway.trim() },
      serial: { baud: Number(shown.baud), parity: shown.parity, address: Number(shown.station) },
    };
    try {
      await write('PUT', 'settings', wish);
      setErrors({});
      setEntry(null);
    } catch (error) {
      setErrors(Object.fromEntries(error.details.map((d) => [d.parameter, detail(d)])));
      if (!error.details.length) note(error.message, true);
    }
    again();
  };
  const act = async (method, path, done) => {
    await attempt(method, path, {}, done);
    ask(false);
    again();
  };
  const fixed = shown.dhcp === 'fixed';
  const [kind, words, means] = STATES[settings.state] ?? ['on', settings.state, ''];
  return html`<section class="card stack" aria-label="Stored settings"><h2>Stored settings</h2>
      <p><${Lamp} on=${true} kind=${kind}>${sentence(words)}<//></p>
      <p>${settings.why ? html`<b>${sentence(settings.why)}.</b> ` : ''}${means}</p>
      ${settings.note ? html`<p class="quiet">${sentence(settings.note)}.</p>` : null}
      <p class="row">${settings.state === 'undecided'
        ? html`<button type="button" class="main"
          onClick=${() => act('POST', 'settings/overwrite', 'What is in use is being stored')}>Store what is in use in its place</button>`
        : null}
        ${settings.state === 'nowhere' ? null : html`<button type="button" onClick=${() => ask(true)}>Empty the flash</button>
          <span class="quiet">${figure(settings.writes_left, 0)} changes can be stored at once</span>`}</p></section>
    <section class="card" aria-label="Ethernet"><h2>Ethernet <small class="quiet">now ${host(network.now)}</small></h2>
      <div class="two fields">
        ${select('dhcp', 'network', 'Address', [['dhcp', 'from a DHCP server'], ['fixed', 'fixed']])}
        ${fixed ? input('address', 'network.address', 'Address and bits of the network', { hint: 'such as 192.168.0.10/24' }) : null}
        ${fixed ? input('gateway', 'network.gateway', 'Gateway', { hint: 'empty: none' }) : null}
      </div></section>
    <section class="card" aria-label="Serial line"><h2>Serial line <small class="quiet">now ${line(serial.now)}</small></h2>
      <div class="two fields">
        ${input('baud', 'serial.baud', 'Speed', { unit: 'Bd', mode: 'numeric' })}
        ${select('parity', 'serial.parity', 'Parity', [['even', 'even'], ['odd', 'odd'], ['none', 'none, two stop bits']])}
        ${input('station', 'serial.address', 'Modbus station', { mode: 'numeric', hint: '1 to 247' })}
      </div></section>
    <p class="row"><button type="button" class="main" disabled=${!dirty} onClick=${put}>For the next start</button>
      ${dirty ? html`<button type="button" onClick=${() => (setEntry(null), setErrors({}))}>Discard</button>` : null}
      ${settings.restart ? html`<span><${Lamp} on=${true} kind="half">The next start has ${host(network.next)}; ${line(serial.next)}<//></span>` : null}</p>
    ${asking
      ? html`<${Dialog} title="Empty the flash" onclose=${() => ask(false)}>
        <p>The next start has the machine, the network and the serial line of a new board. What runs now runs on.</p>
        <div class="row end"><button type="button" onClick=${() => ask(false)}>Keep it</button>
          <button type="button" class="main" onClick=${() => act('DELETE', 'settings', 'The flash is being emptied')}>Empty it</button></div><//>`
      : null}`;
}
