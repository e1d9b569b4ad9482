// A recording in the page: opened, scrubbed, stepped back; and read by somebody else's MCAP reader.

import assert from 'node:assert/strict';
import {execFile} from 'node:child_process';
import path from 'node:path';
import {after, before, test} from 'node:test';
import {promisify} from 'node:util';

import {account, difference, openPage, rememberPixels, ROOT, run, SCENE, startBrowser, startServer, temporaryDirectory,
        until} from './support.mjs';

const directory = temporaryDirectory();
const file = path.join(directory, 'press.mcap');
let server, browser, view, page;

before(async () => {
  // The needle's scripted press begins to push at 1.5 s and is deepest at 3.5 s.
  const {code, stderr} = await run('run', SCENE, '--seconds', '4', '--record', file);
  assert.equal(code, 0, stderr);
  server = await startServer({args: ['--record', directory]});
  browser = await startBrowser();
});

after(async () => {
  await browser?.close();
  server?.api.close();
  await server?.kill();
});

test('opens a recording', async () => {
  view = await openPage(browser, `${server.url}/?recording=/v1/recordings/press.mcap`);
  page = view.page;
  const now = await until('the recording', () => account(page), ({mode}) => mode === 'recording');
  assert.deepEqual(now.errors, []);
});

test('scrubs to any instant, forward and back', async () => {
  for (const time of [3.5, 0.5, 2.25, 3.5]) {
    const shown = await page.evaluate(time => window.adhesim.showAt(time), time);
    // Frames are 1/60 s apart: the nearest is at most half of that away, and a step.
    assert.ok(Math.abs(shown.timeS - time) <= 0.5 / 60 + 1e-3, `${shown.timeS} s instead of ${time} s`);
    const now = await account(page);
    assert.equal(now.hud.step, shown.step);
    await rememberPixels(page, `at ${time}`);
    console.log(`at ${time} s: step ${shown.step}, ${now.hud.forceN.toFixed(2)} N`);
    if (time === 0.5) assert.equal(now.hud.forceN, 0);
    if (time === 3.5) assert.ok(now.hud.forceN > 0.1);
  }
  assert.ok(await difference(page, 'at 0.5', 'at 3.5') > 0.001, 'the same picture before contact and pressed');
});

test('the arrows step through frames', async () => {
  const {step} = (await account(page)).hud;
  await page.mouse.move(400, 200);
  await page.keyboard.press('ArrowLeft');
  const before = await until('a frame back', async () => (await account(page)).hud.step, now => now < step);
  assert.ok(step - before <= 18, `${step - before} steps back: frames are 16 or 17 steps apart`);
  await page.keyboard.press('ArrowRight');
  await until('and forward', async () => (await account(page)).hud.step, now => now === step);
});

test('nothing was complained about', async () => {
  assert.deepEqual((await account(page)).errors, []);
  assert.deepEqual(view.complaints, []);
});

test('@mcap/core reads it', async () => {
  const script = path.join(ROOT, 'tests/recording/read_with_mcap_core.mjs');
  const {stdout} = await promisify(execFile)(process.execPath, [script, file]);
  console.log(stdout.trim());
});
