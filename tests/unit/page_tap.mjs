/* SPDX-License-Identifier: MIT */
// Runs tests one after the other, and prints TAP.
const tests = [];
export const test = (name, run) => tests.push([name, run]);

export async function runTests() {
  console.log(`1..${tests.length}`);
  for (const [i, [name, run]] of tests.entries()) {
    try {
      await run();
      console.log(`ok ${i + 1} - ${name}`);
    } catch (error) {
      console.log(`not ok ${i + 1} - ${name}\n# ${error.stack.replace(/\n/g, '\n# ')}`);
      process.exitCode = 1;
    }
  }
}
