/* SPDX-License-Identifier: MIT */
// This makes a folder. At the end, however the program ends, it removes the folder and kills the started processes. It
// also prints TAP.
import {mkdtempSync, rmSync, writeFileSync} from 'node:fs';
import {tmpdir} from 'node:os';

export const folder = mkdtempSync(`${tmpdir()}/scanhead-page-`);
const started = new Set(); // process groups and processes

process.on('exit', () => {
  for (const pid of started) {
    try {
      process.kill(pid, 'SIGKILL');
    } catch { /* it has ended already */ }
  }
  rmSync(folder, {recursive: true, force: true, maxRetries: 5});
});
for (const [signal, status] of [['SIGINT', 130], ['SIGTERM', 143], ['SIGHUP', 129]]) process.on(signal, () => process.exit(status));

/** pid is that of a process, or the negative one of its group. */
export function remember(pid) {
  started.add(pid);
}

export function forget(pid) {
  started.delete(pid);
}

/** Writes a file into the folder and returns its path. */
export function write(name, text) {
  writeFileSync(`${folder}/${name}`, text);
  return `${folder}/${name}`;
}

// ---- TAP
let results = 0, failures = 0;
const comment = (text) => String(text).split('\n').slice(0, 20).forEach((line) => console.log(`# ${line}`));

let explain = async () => '';

/** After a failed test this function is asked, and its text is shown. */
export function whenFailed(ask) {
  explain = ask;
}

/** Runs one test, which fails by throwing. A failed test does not end the others. */
export async function test(name, body) {
  results++;
  try {
    await body();
    console.log(`ok ${results} - ${name}`);
  } catch (error) {
    failures++;
    console.log(`not ok ${results} - ${name}`);
    comment(error.stack ?? error);
    comment(await explain().catch((why) => why));
  }
}

/** Prints the plan at the end and exits with the status. */
export function finish() {
  console.log(`1..${results}`);
  process.exit(failures > 0 ? 1 : 0);
}

/** After so many seconds the program gives up and says so. */
export function giveUpAfter(limit_s) {
  setTimeout(() => {
    console.log(`Bail out! not at its end after ${limit_s} s`);
    process.exit(1);
  }, 1000 * limit_s).unref();
}

export function equal(got, wanted, what) {
  if (!Object.is(got, wanted)) throw new Error(`${what}: ${got}, wanted ${wanted}`);
}

export function near(got, wanted, tolerance, what) {
  if (!(Math.abs(got - wanted) <= tolerance)) throw new Error(`${what}: ${got}, wanted ${wanted} within ${tolerance}`);
}

export function is(condition, what) {
  if (!condition) throw new Error(`not so: ${what}`);
}
