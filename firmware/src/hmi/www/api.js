/**
 * The HTTP API: requests, errors as people read them, who is logged in, who controls.
 *
 * Not here: the live stream, which is `live.js`'s, and what a page makes of an answer.
 */
import { signal } from './vendor/ui.js';

/** What the simulator tells of itself; null before the first answer. */
export const info = signal(null);
/** The dialog that asks for a password: null, or `{ resolve }` of the write that waits for it. */
export const asking = signal(null);
/** Short messages at the edge of the page. */
export const notes = signal([]);

/** An answer that is not the wanted one. */
export class ApiError extends Error {
  constructor(status, body) {
    super(body.error || `the simulator answers ${status}`);
    this.status = status;
    /** `[{ parameter, value, limit, unit, reason }]` */
    this.details = body.details || [];
  }
}

async function request(method, path, body) {
  const init = { method, headers: {}, credentials: 'same-origin', cache: 'no-store' };
  if (method !== 'GET') {
    init.headers['Content-Type'] = 'application/json';
    init.body = JSON.stringify(body ?? {});
  }
  let answer;
  try {
    answer = await fetch('/api/v1/' + path, init);
  } catch {
    throw new ApiError(0, { error: 'the simulator does not answer' });
  }
  const json = (answer.headers.get('content-type') || '').includes('json');
  const content = json ? await answer.json().catch(() => ({})) : await answer.text();
  if (!answer.ok) throw new ApiError(answer.status, json ? content : { error: content });
  return content;
}

/** Reads. */
export const get = (path) => request('GET', path);

/** Nobody gave the password that was asked for. */
const CANCELLED = 401;

/** Writes. Asks for the password first where it is missing, and again when the session has ended. */
export async function write(method, path, body) {
  const open = path === 'login' || path === 'password';
  if (!open && info.value?.auth?.logged_in === false && !(await login()))
    throw new ApiError(CANCELLED, { error: 'not logged in' });
  for (;;) {
    try {
      return await request(method, path, body);
    } catch (error) {
      if (error.status !== 401 || open || !(await login())) throw error;
    }
  }
}

/** Asks for the password; true once logged in. */
export function login() {
  asking.value?.resolve(false);
  return new Promise((resolve) => {
    asking.value = {
      async resolve(done) {
        asking.value = null;
        if (done) await refresh();
        resolve(done);
      },
    };
  });
}

/** A short message; `bad` stays longer. */
export function note(text, bad = false) {
  const one = { text, bad };
  notes.value = [...notes.value.slice(-3), one];
  setTimeout(() => (notes.value = notes.value.filter((other) => other !== one)), bad ? 9000 : 3500);
}

/** Writes, and says so when it fails; true if it did not. */
export async function attempt(method, path, body, done) {
  try {
    await write(method, path, body);
    if (done) note(done);
    return true;
  } catch (error) {
    if (error.status !== CANCELLED) note(error.message + error.details.map((d) => `: ${detail(d)}`).join(''), true);
    return false;
  }
}

/** A rejected value in words. */
export function detail({ parameter, value, low, high, limit, unit, reason }) {
  const of = unit ? ' ' + unit : '';
  const known = (v) => v !== undefined && v !== null;
  const limits =
    known(low) && known(high) ? `, ${low} to ${high}${of} is permitted` : known(limit) ? `, limit ${limit}${of}` : '';
  return `${parameter} = ${value}: ${reason || 'not permitted'}${limits}`;
}

/** Asks again what the simulator tells of itself. */
export async function refresh() {
  try {
    info.value = await get('info');
  } catch {
    // the stream shows that the simulator is gone
  }
}

/** A file for the person at the page. */
export function save(name, blob) {
  const a = document.createElement('a');
  a.href = URL.createObjectURL(blob);
  a.download = name;
  a.click();
  setTimeout(() => URL.revokeObjectURL(a.href), 1000);
}
