// A page left open: 3,000 frames in the gate, an hour at full size. It keeps no more memory than its history needs.

import assert from 'node:assert/strict';
import {test} from 'node:test';

import {account, FULL_SIZE, openPage, startBrowser, startServer, until} from './support.mjs';

const FRAMES = 3000;
const SECONDS = FULL_SIZE ? 3600 : 0;
// The history for stepping back is full by then: it keeps the last 600 frames.
const WARM_UP_FRAMES = 800;

test(`after ${FRAMES} frames${FULL_SIZE ? ' and an hour' : ''} the page is as it was`, async t => {
  const server = await startServer();
  t.after(() => { server.api.close(); return server.kill(); });
  const browser = await startBrowser();
  t.after(() => browser.close());
  const {page, complaints} = await openPage(browser, `${server.url}/?scene=needle_organ`, {width: 480, height: 360});
  const devtools = await page.context().newCDPSession(page);
  const memory = async () => {
    await devtools.send('HeapProfiler.collectGarbage');
    const {usedSize, backingStorageSize = 0} = await devtools.send('Runtime.getHeapUsage');
    return (usedSize + backingStorageSize) / 1e6;
  };
  const framesReceived = async () => (await account(page)).framesReceived;
  // At 10 frames a second at least.
  const patience = FRAMES * 100 + SECONDS * 1000;
  const began = performance.now();

  await until('the first frames', framesReceived, frames => frames > WARM_UP_FRAMES, patience);
  const early = await memory();
  const frames = await until(`${FRAMES} frames`, framesReceived, frames =>
    frames > FRAMES && performance.now() - began > 1000 * SECONDS, patience);
  const late = await memory();
  console.log(`memory of the page: ${early.toFixed(1)} MB after ${WARM_UP_FRAMES} frames, ` +
              `${late.toFixed(1)} MB after ${frames}`);
  // A frame is 18 kB and more: one in ten kept would be 4 MB in the gate.
  assert.ok(late < early + 4, `${late - early} MB more`);
  const now = await account(page);
  assert.equal(now.connection, 'connected');
  assert.deepEqual(now.errors, []);
  assert.deepEqual(complaints, []);
});
