export { h, render, Fragment } from 'preact';
export { useState, useEffect, useLayoutEffect, useRef, useMemo, useId } from 'preact/hooks';
export { signal, computed, effect, batch, untracked, useSignal, useComputed } from '@preact/signals';
import { h } from 'preact';
import htm from 'htm';
export const html = htm.bind(h);
