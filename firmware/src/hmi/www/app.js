/**
 * The page: its frame, its way from page to page, what stands above all of them.
 *
 * Not here: what a page shows. The first one is loaded with the frame, the others when they are asked for.
 */
import { html, render, signal, effect, useState, useEffect, useRef } from './vendor/ui.js';
import { info, notes, asking, refresh, login, attempt, write, note } from './api.js';
import { start, state, counts, code, bit, signals } from './live.js';
import { Icon, Dialog, Field, Lamp, sentence } from './parts.js';
import { Machine } from './pages/machine.js';

const PAGES = [
  ['machine', 'Machine'],
  ['trends', 'Trends'],
  ['parameters', 'Parameters'],
  ['autotune', 'Auto-tune'],
  ['drive', 'Drive'],
  ['faults', 'Faults'],
  ['link', 'Link'],
  ['session', 'Session'],
  ['training', 'Training'],
  ['acceptance', 'Acceptance'],
  ['health', 'Health'],
];
/** What somebody in training does not see: what is put in, and the simulator's own. */
const HIDDEN = ['faults', 'session', 'acceptance'];

const page = signal('machine');
const trainee = signal(keep('view') === 'trainee');
const theme = signal(keep('theme') || 'auto');
const loaded = new Map([['machine', Machine]]);

/** What the browser keeps for us; it may refuse to. */
function keep(key, content) {
  try {
    if (content === undefined) return localStorage.getItem(key);
    localStorage.setItem(key, content);
  } catch {
    // then it lasts as long as the page
  }
  return null;
}

const shown = () => PAGES.filter(([id]) => !(trainee.value && HIDDEN.includes(id)));

function route() {
  const id = location.hash.replace(/^#\//, '');
  page.value = shown().some(([known]) => known === id) ? id : 'machine';
}

effect(() => {
  document.documentElement.dataset.theme = theme.value;
  keep('theme', theme.value);
});
effect(() => {
  const [, name] = PAGES.find(([id]) => id === page.value);
  document.title = `${name} · Winder simulator`;
});

/** A page that is fetched when it is first shown. */
function Page({ id }) {
  const [, again] = useState(0);
  const [error, fail] = useState(null);
  useEffect(() => {
    if (loaded.has(id)) return;
    import(`./pages/${id}.js`).then(
      (module) => {
        loaded.set(id, module.default);
        fail(null);
        again((n) => n + 1);
      },
      () => fail('This page could not be loaded: the simulator does not answer.'),
    );
  }, [id]);
  const Shown = loaded.get(id);
  if (Shown) return html`<${Shown} trainee=${trainee.value} />`;
  return html`<p class="card wait">${error || 'Loading …'}</p>`;
}

/** Who commands the winder. */
function Control() {
  const control = info.value?.control;
  const by = control?.by;
  const words = {
    plc: ['PLC', control?.plc || ''],
    panel: ['Panel', 'this page commands'],
    nobody: ['No control', 'nobody commands'],
  };
  const [short, long] = words[by] ?? ['…', ''];
  return html`<span class=${`control by-${by}`} title=${`${short} ${long}`}><i>Control</i><b>${short}</b><span>
    ${by === 'plc' ? long : ''}</span></span>`;
}

const LINK = { waiting: 'connecting', live: 'live', lost: 'no data' };

function Top() {
  const next = { auto: 'light', light: 'dark', dark: 'auto' };
  const sign = { auto: 'auto', light: 'sun', dark: 'moon' };
  const mode = counts('mode').value;
  const logged = info.value?.auth?.logged_in;
  return html`<header class="top">
    <a class="brand" href="#/machine" aria-label="Winder simulator, machine page">
      <svg class="logo" viewBox="0 0 32 32" aria-hidden="true"><circle cx="16" cy="11" r="9" />
        <circle cx="16" cy="11" r="2.5" /><circle cx="8.5" cy="25" r="5" /><circle cx="23.5" cy="25" r="5" /></svg>
      <b>Winder</b></a>
    <span class="tag sim">Simulated</span>
    <span class="mode" aria-live="polite"><i>Mode</i><b>${mode === null ? '…' : sentence(code('mode'))}</b></span>
    <${Control} />
    <span class="stream ${state.value}"><${Lamp} on=${state.value === 'live'} kind="ok">${LINK[state.value]}<//></span>
    <span class="tools">
      <button type="button" class="plain" title=${`Colours: ${theme.value}`}
        aria-label=${`Colours: ${theme.value}; change`}
        onClick=${() => (theme.value = next[theme.value])}><${Icon} name=${sign[theme.value]} /></button>
      <${Account} logged=${logged} />
    </span>
  </header>`;
}

function Account({ logged }) {
  const [open, set] = useState(false);
  const leave = async () => {
    // the trainer's password, not the trainee's wish
    if (trainee.value && !(await login())) return;
    trainee.value = !trainee.value;
    keep('view', trainee.value ? 'trainee' : '');
    if (trainee.value) await attempt('POST', 'logout', {});
    refresh();
    route();
    set(false);
  };
  return html`<button type="button" class="plain" aria-label="Access" title="Access" onClick=${() => set(true)}>
    <${Icon} name="key" /></button>
    ${
      open
        ? html`<${Dialog} title="Access" onclose=${() => set(false)}>
          <p>${logged ? 'You are logged in: this page may change things.' : 'Everybody may look. Changes need the password.'}</p>
          <div class="row">
            ${
              logged
                ? html`<button type="button"
                  onClick=${async () => (await attempt('POST', 'logout', {}, 'Logged out')) && (refresh(), set(false))}>Log out</button>`
                : html`<button type="button" class="main" onClick=${() => (set(false), login())}>Log in</button>`
            }
            <button type="button" onClick=${leave}>${trainee.value ? 'Leave the trainee view' : 'Trainee view'}</button>
          </div>
          <p class="quiet">The trainee view shows no faults that are put in, no snapshots, no acceptance. Leaving it takes the password.</p>
        <//>`
        : null
    }`;
}

/** The way between the pages; on a narrow screen it scrolls, and the present one is in sight. */
function Pages() {
  const list = useRef();
  const at = page.value;
  useEffect(() => {
    const one = list.current.querySelector('[aria-current]');
    list.current.scrollLeft = one.offsetLeft - (list.current.clientWidth - one.clientWidth) / 2;
  }, [at]);
  return html`<nav class="pages" aria-label="Pages" ref=${list}>
    ${shown().map(([id, name]) => html`<a key=${id} href=${`#/${id}`} aria-current=${at === id ? 'page' : undefined}>
      <${Icon} name=${id} /><span>${name}</span></a>`)}
  </nav>`;
}

/** What is wrong, as long as it is. */
function Alarm() {
  const fault = counts('fault').value;
  const refusal = counts('refusal').value;
  const broken = bit('winder_status', 'web_break');
  const warnings = signals.value.get('warnings')?.bits.filter((b) => (counts('warnings').value >> b.number) & 1) ?? [];
  const acknowledge = () => attempt('POST', 'panel', { action: 'acknowledge' });
  const plc = info.value?.control?.by === 'plc';
  return html`<div class=${`alarms ${state.value}`} role="status" aria-live="assertive">
    ${
      state.value === 'lost'
        ? html`<p class="alarm stale"><svg class="icon" viewBox="0 0 24 24" aria-hidden="true">
          <path d="M12 7v6m0 3v1M12 21a9 9 0 1 0 0-18 9 9 0 0 0 0 18Z" /></svg>
          <span><b>No data from the simulator.</b> The values are the last ones that came. Trying again …</span></p>`
        : null
    }
    ${
      fault
        ? html`<p class="alarm bad"><${Icon} name="faults" /><span><b>Fault ${fault}
          </b> ${code('fault')}${broken && fault !== 2 ? '; web break' : ''}</span>
          ${plc ? html`<i>the PLC acknowledges</i>` : html`<button type="button"
            onClick=${acknowledge}>Acknowledge</button>`}</p>`
        : null
    }
    ${warnings.map((w) => html`<p class="alarm warn" key=${w.name}><${Icon} name="faults" /><span>
      <b>Warning</b> ${w.description}</span></p>`)}
    ${
      info.value?.settings === 'undecided'
        ? html`<p class="alarm warn"><${Icon} name="faults" /><span><b>Settings</b> What stands in the flash is of no use:
          the defaults are in use, and nothing is stored until somebody decides, under Parameters, Board.</span></p>`
        : null
    }
    ${refusal && !fault ? html`<p class="alarm info"><span><b>Refused</b> ${code('refusal')}</span></p>` : null}
  </div>`;
}

/** Asks for the password, or for a first one. */
function Password() {
  const [error, fail] = useState('');
  const [busy, work] = useState(false);
  const first = info.value?.auth?.password_set === false;
  const submit = async (event) => {
    event.preventDefault();
    const form = new FormData(event.target);
    if (first && form.get('password') !== form.get('again')) return fail('The two are not the same.');
    work(true);
    try {
      await write('POST', first ? 'password' : 'login', { password: form.get('password') });
      note(first ? 'Password set; you are logged in' : 'Logged in');
      asking.value?.resolve(true);
    } catch (e) {
      // somebody else was first
      if (first) await refresh();
      fail(e.message);
    }
    work(false);
  };
  return html`<${Dialog} title=${first ? 'Choose a password' : 'Password'}
    onclose=${() => asking.value?.resolve(false)}>
    <form onSubmit=${submit}>
      <p>${first ? 'Nobody has set one yet. From now on it is asked for before anything is changed.' : 'Changes need the password.'}</p>
      <input type="text" name="user" autocomplete="username" value="winder" hidden aria-hidden="true" tabindex="-1" />
      <${Field} label="Password" error=${error}>${(a) => html`<input ...${a} type="password" name="password" required
        autocomplete=${first ? 'new-password' : 'current-password'} />`}<//>
      ${first ? html`<${Field} label="Once more">
        ${(a) => html`<input ...${a} type="password" name="again" required autocomplete="new-password" />`}<//>` : null}
      <div class="row end"><button type="button" onClick=${() => asking.value?.resolve(false)}>Cancel</button>
        <button type="submit" class="main" disabled=${busy}>${first ? 'Set password' : 'Log in'}</button></div>
    </form><//>`;
}

function App() {
  return html`<${Top} /><${Alarm} />
    <${Pages} />
    <main id="main" class=${`page-${page.value}`} tabindex="-1"><${Page} id=${page.value} /></main>
    <div class="notes" role="status" aria-live="polite">${notes.value.map((n) => html`<p class=${n.bad ? 'bad' : ''}>
      ${n.text}</p>`)}</div>
    ${asking.value ? html`<${Password} />` : null}`;
}

addEventListener('hashchange', () => {
  route();
  scrollTo(0, 0);
});
route();
const root = document.getElementById('app');
root.replaceChildren();
render(html`<${App} />`, root);
start();
refresh();
setInterval(() => document.hidden || refresh(), 1000);
