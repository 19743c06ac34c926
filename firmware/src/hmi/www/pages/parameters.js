/**
 * The parameters page: the machine by its parts, changed in a draft that is applied as one.
 *
 * Not here: the limits, which the simulator tells and checks again. A value that it would refuse is not sent.
 *
 * The draft is the simulator's own (`parameters/staged`), so that two pages show the same one.
 */
import { html, useState, useEffect, useRef } from '../vendor/ui.js';
import { get, write, attempt, note, save, detail, info } from '../api.js';
import { Icon, Dialog, Switch, useGet, sentence } from '../parts.js';
import Board, { Kept } from './board.js';

/** The parts as people call them. */
const PARTS = {
  web: 'Web',
  parent_roll: 'Parent roll',
  idle: 'Idle rolls',
  load_cells: 'Load cells',
  rear_drum: 'Rear drum',
  front_drum: 'Front drum',
  rider_roll: 'Rider roll',
  shipping_roll: 'Shipping roll',
  nips: 'Nips',
  wound_on_tension: 'Wound-on tension',
  motors: 'Motors',
  brakes: 'Brakes',
  operation: 'Operation',
};
const SECTION = { uw: 'unwind', rd: 'rear drum', fd: 'front drum', rr: 'rider roll' };

/** The heading a part belongs under: `idle[0]` under idle rolls. */
const group = (part) => part.split(/[.[ ]/)[0] || 'machine';

/** What a part is called. */
function title(part) {
  const head = PARTS[group(part)] ?? (group(part) ? sentence(group(part).replace(/_/g, ' ')) : 'Machine');
  const index = part.match(/\[(\d+)\]/);
  const rest = part.match(/\.(\w+)/);
  if (rest && SECTION[rest[1]]) return `${head}: ${SECTION[rest[1]]}`;
  if (rest) return `${head}: ${rest[1].replace(/_/g, ' ')}${index ? `, point ${+index[1] + 1}` : ''}`;
  return index ? `${head}: ${+index[1] + 1}` : head;
}

/** A number with as many digits as it has. */
const plain = (v) => (v === null || v === undefined ? '–' : typeof v === 'number' ? String(Number(v.toPrecision(12))) : String(v));
/** The same for reading: thin spaces every three digits of a long number. */
const spaced = (v) =>
  plain(v)
    .replace(/^-?\d{5,}/, (whole) => whole.replace(/\B(?=(\d{3})+$)/g, '\u2009'))
    .replace('-', '\u2212');
const same = (a, b) => a === b || (typeof a === 'number' && Math.abs(a - b) <= 1e-12 * Math.abs(b));

/** Why a value cannot be, or nothing. */
function wrong(p, entry) {
  if (p.kind === 'switch' || p.kind === 'choice') return '';
  const n = Number(entry);
  if (String(entry).trim() === '' || !Number.isFinite(n)) return `${entry || 'nothing'} is not a number`;
  const unit = p.unit ? ' ' + p.unit : '';
  if (p.low !== null && n < p.low) return `${entry}${unit} is below the lowest, ${plain(p.low)}${unit}`;
  if (p.high !== null && n > p.high) return `${entry}${unit} is above the highest, ${plain(p.high)}${unit}`;
  return '';
}

/** A value as a machine file has it. */
const toml = (v) => (typeof v === 'string' ? JSON.stringify(v) : plain(v));

/** A machine file, as `cargo winder machine` writes and reads it: the preset, and what differs. A list is whole. */
function file(machine, parts) {
  const all = parts.flatMap((part) => part.parameters).map((p) => ({ ...p, now: p.staged ?? p.value }));
  const differs = (p) => !same(p.now, p.default);
  const list = (name) => name.match(/^(.+)\[\d+\]\.|^(.+) \(/)?.slice(1).find(Boolean);
  const changed = new Set(all.filter(differs).map((p) => list(p.name)));
  const tables = new Map([['', '']]);
  for (const p of all) {
    const of = list(p.name);
    if (p.name.includes(' (') || p.now === null || !(of ? changed.has(of) : differs(p))) continue;
    const at = p.name.lastIndexOf('.');
    const table = p.name.slice(0, Math.max(0, at));
    const head = of ? `\n[[${of}]]\n` : `\n[${table}]\n`;
    tables.set(table, (tables.get(table) ?? head) + `${p.name.slice(at + 1)} = ${toml(p.now)}\n`);
  }
  return `preset = "${machine}"\n` + [...tables.values()].join('');
}

/** The values of a machine file, by name; the length of a list stands before its elements. */
export function values(text, known) {
  const found = {};
  const lengths = {};
  let preset = null;
  let table = '';
  text.split(/\r?\n/).forEach((line, i) => {
    const bare = line.replace(/#.*$/, '').trim();
    if (!bare) return;
    const [, list, part] = bare.match(/^\[\[\s*([\w.]+)\s*\]\]$|^\[\s*([\w.]+)\s*\]$/) ?? [];
    if (list) {
      const length = [...known.keys()].find((name) => name.startsWith(list + ' ('));
      if (!length) throw new Error(`Line ${i + 1}: a machine has no list ${list}`);
      lengths[length] = (lengths[length] ?? 0) + 1;
      table = `${list}[${lengths[length] - 1}].`;
      return;
    }
    if (part) return void (table = part + '.');
    const pair = bare.match(/^([\w.]+)\s*=\s*(.+)$/);
    if (!pair) throw new Error(`Line ${i + 1}: “${bare}” is not name = value`);
    const [, key, content] = pair;
    if (key === 'preset' && !table) return void (preset = content.replace(/"/g, ''));
    const name = table + key;
    if (!known.has(name) && !table.includes('[')) throw new Error(`Line ${i + 1}: a machine has no parameter ${name}`);
    const number = Number(content.replace(/_/g, ''));
    const value = content === 'true' ? true : content === 'false' ? false : number;
    if (Number.isNaN(value)) throw new Error(`Line ${i + 1}: ${content} is not a value`);
    found[name] = value;
  });
  return { preset, found: { ...lengths, ...found } };
}

function Row({ p, error, locked, onstage }) {
  const [entry, setEntry] = useState(null);
  const now = p.staged ?? p.value;
  const shown = entry ?? plain(now);
  const bad = entry !== null ? wrong(p, entry) : '';
  const reason = bad || error;
  const changed = p.staged !== null && p.staged !== undefined && !same(p.staged, p.value);
  const commit = async () => {
    if (entry === null || bad) return;
    if (!same(Number(entry), now)) await onstage({ [p.name]: Number(entry) });
    setEntry(null);
  };
  const unit = p.unit;
  const name = p.name.split('.').pop();
  const label = `${p.name}: ${p.description}`;
  return html`<li class=${`parameter ${changed ? 'changed' : ''} ${reason ? 'bad' : ''}`}>
    <div class="about"><b>${sentence(p.description)}</b><code>${name}</code></div>
    <div class="entry">
      ${
        p.kind === 'switch'
          ? html`<${Switch} on=${now} disabled=${locked} label=${html`<span class="hidden">${label}</span>
            ${now ? 'on' : 'off'}`} onchange=${(v) => onstage({ [p.name]: v })} />`
          : p.kind === 'choice'
            ? html`<select aria-label=${label} disabled=${locked} value=${String(now)}
              onChange=${(e) => onstage({ [p.name]: e.target.value })}>
                ${(p.choices ?? []).map((c) => html`<option key=${c}>${c}</option>`)}</select>`
            : html`<input type="text" inputmode="decimal" aria-label=${label}
              aria-invalid=${reason ? 'true' : undefined} aria-describedby=${reason ? p.name : undefined} value=${shown}
                disabled=${locked}
              onInput=${(e) => setEntry(e.target.value.replace(',', '.'))} onBlur=${commit}
                onKeyDown=${(e) => (e.key === 'Enter' ? commit() : e.key === 'Escape' ? setEntry(null) : null)} /><i>
                  ${unit}</i>`
      }
    </div>
    <div class="range">${p.kind !== 'switch' && p.kind !== 'choice' ? html`<span>${spaced(p.low)} … ${spaced(p.high)}</span>` : html`<span />`}
      <span>default ${p.kind === 'switch' ? (p.default ? 'on' : 'off') : spaced(p.default)}</span></div>
    <div class="change">${changed ? html`<span>was ${spaced(p.value)}</span>` : ''}
      ${!same(now, p.default) ? html`<button type="button" class="plain" disabled=${locked}
        aria-label=${`${p.name}: back to its default`} title="Back to its default"
          onClick=${() => onstage({ [p.name]: p.default })}><${Icon} name="undo" /></button>` : ''}</div>
    ${reason ? html`<p class="reason" id=${p.name} role="alert">${reason}</p>` : null}
  </li>`;
}

export default function Parameters() {
  const [answer, set] = useState(null);
  const [presets, setPresets] = useState([]);
  const [at, choose] = useState('web');
  const [search, find] = useState('');
  const [errors, setErrors] = useState({});
  const [open, setOpen] = useState(null);
  const upload = useRef();
  const [settings, , again] = useGet('settings', 2000);
  const revision = info.value?.revision;

  const load = async () => {
    try {
      const fresh = await get('parameters');
      set(fresh);
      return fresh.revision;
    } catch (error) {
      note(error.message, true);
      return null;
    }
  };
  useEffect(() => {
    load();
  }, [revision]);
  // the lock comes and goes with the web
  useEffect(() => {
    const timer = setInterval(() => document.hidden || load(), 4000);
    get('presets').then(
      (list) => setPresets((list.presets ?? list).map((p) => (typeof p === 'string' ? { name: p } : p))),
      () => {},
    );
    return () => clearInterval(timer);
  }, []);
  if (!answer) return html`<div class="head"><h1>Parameters</h1></div><p class="card wait">Loading …</p>`;

  const all = answer.parts.flatMap((part) => part.parameters);
  const known = new Map(all.map((p) => [p.name, p]));
  const changes = all.filter((p) => p.staged !== null && p.staged !== undefined && !same(p.staged, p.value));
  /** Why a change of a revision was not taken; shows what is so now. */
  const refused = async (error, of) => {
    setErrors((old) => ({ ...old, ...Object.fromEntries(error.details.map((d) => [d.parameter, detail(d)])) }));
    const overtaken = (await load()) !== of && error.status === 409;
    const why = overtaken ? 'Somebody else has applied a change in the meantime, so this one was not taken: ' : '';
    note(why + error.message, true);
  };
  const stage = async (wanted) => {
    try {
      await write('PUT', 'parameters/staged', { revision: answer.revision, values: wanted });
      setErrors((old) => Object.fromEntries(Object.entries(old).filter(([name]) => !(name in wanted))));
      await load();
    } catch (error) {
      await refused(error, answer.revision);
    }
  };
  // what is applied is what was reviewed, whatever has come since
  const apply = async (reviewed) => {
    try {
      const { revision: next } = await write('POST', 'parameters/apply', { revision: reviewed });
      note(`Applied: the machine is revision ${next ?? reviewed + 1}`);
      setOpen(null);
      await load();
    } catch (error) {
      await refused(error, reviewed);
    }
  };
  const preset = async (name) => {
    await attempt(
      'POST',
      'parameters/preset',
      { name, revision: answer.revision },
      `${name} is in the draft: apply it to change the machine`,
    );
    setOpen(null);
    load();
  };
  const take = async (event) => {
    const [chosen] = event.target.files;
    event.target.value = '';
    if (!chosen) return;
    try {
      const { preset: base, found } = values(await chosen.text(), known);
      if (base && base !== answer.machine)
        await write('POST', 'parameters/preset', { name: base, revision: answer.revision });
      if (Object.keys(found).length) await stage(found);
      note(`${chosen.name}: in the draft`);
    } catch (error) {
      note(`${chosen.name}: ${error.message}`, true);
    }
    load();
  };

  const groups = [...new Set(answer.parts.map((part) => group(part.part)))];
  const hit = (p) => `${p.name} ${p.description}`.toLowerCase().includes(search.toLowerCase());
  const shown = answer.parts
    .map((part) => ({
      ...part,
      parameters: part.parameters.filter((p) =>
        search ? hit(p) : at === 'changed' ? !same(p.staged ?? p.value, p.default) : group(part.part) === at,
      ),
    }))
    .filter((part) => part.parameters.length);
  const different = all.filter((p) => !same(p.staged ?? p.value, p.default)).length;

  return html`<div class="head"><h1>Parameters</h1>
      <span class="quiet"><b>${answer.machine}</b>, revision ${answer.revision}</span>
      <${Kept} settings=${settings} />
      <span class="row"><button type="button" onClick=${() => setOpen('presets')}
        disabled=${answer.locked}>Presets</button>
        <button type="button" onClick=${() => upload.current.click()} disabled=${answer.locked}>Import</button>
        <input type="file" accept=".toml,text/plain" ref=${upload} hidden aria-label="Machine file" onChange=${take} />
        <button type="button"
          onClick=${() => save(`${answer.machine}.toml`, new Blob([file(answer.machine, answer.parts)], { type: 'application/toml' }))}>Export</button></span>
    </div>
    ${answer.locked ? html`<p class="card locked">
      <b>Locked.</b> ${sentence(answer.locked_why || 'the web runs')}.</p>` : null}
    <div class="parameters">
      <nav class="card parts" aria-label="Parts of the machine">
        <input type="search" placeholder="Search" aria-label="Search the parameters" value=${search}
          onInput=${(e) => find(e.target.value)} />
        <ul>${groups.map((g) => {
          const edited = changes.filter(
            (p) => group(answer.parts.find((part) => part.parameters.includes(p)).part) === g,
          ).length;
          return html`<li key=${g}><button type="button" class="plain"
            aria-pressed=${!search && at === g ? 'true' : 'false'} onClick=${() => (choose(g), find(''))}>
              ${PARTS[g] ?? sentence(g.replace(/_/g, ' '))}${edited ? html`<em title="changes in the draft">${edited}
                </em>` : ''}</button></li>`;
        })}
          <li><button type="button" class="plain" aria-pressed=${!search && at === 'changed' ? 'true' : 'false'}
            onClick=${() => (choose('changed'), find(''))}>Differs from the default<em>${different}</em></button></li>
          <li><button type="button" class="plain" aria-pressed=${!search && at === 'board' ? 'true' : 'false'}
            onClick=${() => (choose('board'), find(''))}>Board</button></li>
              </ul>
      </nav>
      <div class="stack">
        ${at === 'board' && !search ? html`<${Board} settings=${settings} again=${again} />` : null}
        ${shown.map(
          (
            part,
          ) => html`<section class="card" key=${part.part} aria-label=${title(part.part)}><h2>${title(part.part)}</h2>
          <ul>${part.parameters.map((p) => html`<${Row} key=${p.name} p=${p} error=${errors[p.name]}
            locked=${answer.locked} onstage=${stage} />`)}</ul></section>`,
        )}
        ${shown.length || (at === 'board' && !search) ? null : html`<p class="card wait">
          ${search ? `No parameter is called “${search}”.` : 'All are at their defaults.'}</p>`}
      </div>
    </div>
    ${
      changes.length
        ? html`<div class="draft" role="region" aria-label="Draft"><span><b>
          ${changes.length} ${changes.length === 1 ? 'change' : 'changes'}
            </b> in the draft; the machine runs on with its old values.</span>
          <span class="row"><button type="button"
            onClick=${async () => (await attempt('DELETE', 'parameters/staged', { revision: answer.revision }, 'Draft discarded')) && (setErrors({}), load())}>Discard</button>
          <button type="button" class="main" onClick=${() => setOpen(answer.revision)}
            disabled=${answer.locked}>Review and apply</button></span></div>`
        : null
    }
    ${
      typeof open === 'number'
        ? html`<${Dialog} title="Apply as one" onclose=${() => setOpen(null)}>
          <p>The winder is built anew with these values, at standstill: new core, full parent roll, no web.</p>
          <div class="scroll"><table><thead><tr><th>Parameter</th><th class="n">Now</th><th class="n">New</th>
            <th>Unit</th></tr></thead>
            <tbody>${changes.map((p) => html`<tr key=${p.name}><td><code>${p.name}</code></td><td class="n">
              ${spaced(p.value)}</td><td class="n"><b>${spaced(p.staged)}</b></td><td>${p.unit}</td></tr>`)}</tbody>
                </table></div>
          <div class="row end"><button type="button" onClick=${() => setOpen(null)}>Not yet</button>
            <button type="button" class="main" onClick=${() => apply(open)}>Apply</button></div><//>`
        : null
    }
    ${
      open === 'presets'
        ? html`<${Dialog} title="Machines that ship" onclose=${() => setOpen(null)}>
          <ul class="list">${presets.map((p) => {
            const no = p.fits === false || p.offered === false;
            return html`<li key=${p.name}><span><b>${p.name}</b><small>${no ? p.why || p.reason : p.description || ''}
              </small></span><button type="button" disabled=${no} onClick=${() => preset(p.name)}>To the draft</button>
                </li>`;
          })}</ul><//>`
        : null
    }`;
}
