// The page against a real server: it connects, a needle is driven with the mouse, and what it shows is what the API says.

import assert from 'node:assert/strict';
import {after, before, test} from 'node:test';

import {account, difference, openPage, rememberPixels, startBrowser, startServer, until} from './support.mjs';

let server, browser, view, page;

before(async () => {
  server = await startServer();
  browser = await startBrowser();
});

after(async () => {
  await browser?.close();
  server?.api.close();
  await server?.kill();
});

const session = async () => (await server.api.call('GetSession', {session: (await account(page)).session})).session;

// The 3-D view's middle, where the mouse is put.
async function middle(of = page) {
  const box = await of.locator('#canvas').boundingBox();
  return [box.x + box.width / 2, box.y + box.height / 2];
}

async function pause() {
  await page.keyboard.press('Space');
  await until('pause', async () => (await session()).state, state => state === 'SESSION_STATE_PAUSED');
}

// The page shows the very step at which the server stands.
async function caughtUp() {
  const {step} = await session();
  return until(`the page shows step ${step}`, () => account(page), now => now.hud.step === step);
}

test('connects, shows the session and says so', async () => {
  // Paused, so that the needle's scripted motion does not begin before it is taken.
  const {session: {session: id}} =
      await server.api.call('CreateSession', {scene_name: 'needle_organ', paused: true});
  view = await openPage(browser, `${server.url}/?session=${id}`);
  page = view.page;
  console.log(`time to first frame: ${view.firstFrameS.toFixed(2)} s`);
  const now = await account(page);
  assert.equal(now.connection, 'connected');
  assert.equal(now.mode, 'live');
  assert.equal(now.session, id);
  assert.deepEqual(now.hud, {step: 0, forceN: 0, depthM: 0});
});

test('the mouse drives the needle into the organ, and the force rises', async () => {
  await page.mouse.move(...await middle());
  await page.keyboard.press('g');
  await until('control', () => account(page), ({role}) => role === 'controller');
  assert.deepEqual((await session()).operated_tools, ['needle']);
  await page.keyboard.press('Space');
  await until('frames', () => account(page), ({framesShown}) => framesShown > 10);

  // The surface is 10 mm below the tip; a notch is 1 mm.
  const forces = [];
  for (let notch = 0; notch < 24; ++notch) {
    await page.mouse.wheel(0, -100);
    if (notch % 4 !== 3) continue;
    // The needle follows with a limited speed, the tissue settles.
    await page.waitForTimeout(300);
    forces.push((await account(page)).hud.forceN);
  }
  console.log(`force while pressing, N: ${forces.map(force => force.toFixed(2)).join(' ')}`);
  assert.ok(forces.at(-1) > 0.1, `no force: ${forces}`);
  // Elastic tissue pushes back the more, the deeper it is pressed: from the first touch on every station is above the one
  // before, but for 1 % of the last: what is left of the motion when it is read.
  const touch = forces.findIndex(force => force > 0.02 * forces.at(-1));
  for (let i = Math.max(touch, 1); i < forces.length; ++i) {
    assert.ok(forces[i] > forces[i - 1] - 0.01 * forces.at(-1), `the force falls: ${forces}`);
  }
});

test('Space pauses: the step counter stands, and HUD and API agree about that step', async () => {
  await pause();
  const before = await caughtUp();
  await page.waitForTimeout(500);
  const now = await account(page);
  assert.equal(now.hud.step, before.hud.step);
  assert.equal((await session()).step, before.hud.step);

  const {step, frame} = await server.api.frame(now.session);
  assert.equal(step, now.hud.step);
  const {tissue, depth_m: depthM} = frame.tools[0];
  const forceN = Math.hypot(tissue.fx_n, tissue.fy_n, tissue.fz_n);
  assert.ok(forceN > 0.05);
  // Both are computed from the same doubles; only the order of three additions may differ.
  assert.ok(Math.abs(now.hud.forceN - forceN) < 1e-12, `${now.hud.forceN} N in the page, ${forceN} N in the API`);
  assert.equal(now.hud.depthM, depthM);
  // The text is rounded to the digits that it shows, and written ten times a second.
  await until('the text', () => page.textContent('#hud-step'), text => text.endsWith(` ${step}`));
  const shown = {force: await page.textContent('#hud-force'), depth: await page.textContent('#hud-depth')};
  const number = text => Number(text.match(/-?[0-9.]+/)[0]);
  const lastDigit = text => 10 ** -(text.match(/\.([0-9]*)/)?.[1].length ?? 0);
  assert.match(shown.force, / N/);
  assert.ok(Math.abs(number(shown.force) - forceN) <= 0.51 * lastDigit(shown.force), shown.force);
  assert.match(shown.depth, / mm/);
  assert.ok(Math.abs(number(shown.depth) - 1e3 * depthM) <= 0.51 * lastDigit(shown.depth), shown.depth);
});

test('the right arrow makes one step', async () => {
  // While the tool is held, the arrows move it.
  await page.keyboard.press('Escape');
  await until('let go', async () => (await session()).operated_tools, tools => tools.length === 0);
  // A heartbeat that was under way may still name the tool as held by somebody; they come four times a second.
  await page.waitForTimeout(500);
  await until('a viewer', () => account(page), ({role}) => role === 'viewer');
  const {step} = (await account(page)).hud;
  for (let i = 1; i <= 3; ++i) {
    await page.keyboard.press('ArrowRight');
    await until(`step ${i} after ${step}`, async () => ({now: (await session()).step, banner: await page.textContent('#banner')}),
                ({now}) => now === step + i);
    await until('the page shows it', async () => (await account(page)).hud.step, now => now === step + i);
  }
});

test('colour maps and toggles change the picture', async () => {
  await page.selectOption('#colour-map', 'none');
  await rememberPixels(page, 'none');
  // Nothing moves: the same again is the same.
  await rememberPixels(page, 'again');
  assert.equal(await difference(page, 'none', 'again'), 0);
  const seen = ['none'];
  for (const map of ['displacement', 'contact-force', 'strain-energy', 'zone']) {
    await page.selectOption('#colour-map', map);
    // Strain energy comes with the next frame.
    if (map === 'strain-energy') {
      await page.keyboard.press('ArrowRight');
      await caughtUp();
    }
    const changed = await until(`colour map ${map}`, async () => {
      await rememberPixels(page, map);
      // From every other map, too: where nothing is touched, all of them show the same zero.
      return Promise.all(seen.map(other => difference(page, other, map)));
    }, parts => parts.every(part => part > 0));
    seen.push(map);
    console.log(`colour map ${map}: ${changed.map(part => (100 * part).toFixed(2)).join(', ')} % of the pixels differ`);
  }
  await page.selectOption('#colour-map', 'none');
  await page.locator('#colour-map').blur();
  for (const [key, what] of [['w', 'wireframe'], ['t', 'transparent'], ['f', 'forces'], ['c', 'contacts']]) {
    await rememberPixels(page, 'before');
    await page.keyboard.press(key);
    await until(`toggle ${what}`, async () => {
      await rememberPixels(page, what);
      return difference(page, 'before', what);
    }, part => part > 0);
    await page.keyboard.press(key);
    await until(`toggle ${what} back`, async () => {
      await rememberPixels(page, what);
      return difference(page, 'before', what);
    }, part => part === 0);
  }
});

test('a second page watches, and is refused control', async () => {
  await page.keyboard.press('Space');
  await until('going on', async () => (await session()).state, state => state === 'SESSION_STATE_RUNNING');
  await page.keyboard.press('g');
  await until('control', () => account(page), ({role}) => role === 'controller');
  const {session: id} = await account(page);
  const second = await openPage(browser, `${server.url}/?session=${id}`);
  await until('a spectator', () => account(second.page), ({role}) => role === 'spectator');
  const target = async () => (await server.api.frame(id)).frame.tools[0].target;
  const before = await target();
  await second.page.mouse.move(...await middle(second.page));
  await second.page.keyboard.press('g');
  const refusal = await until('a refusal', () => second.page.textContent('#banner'), text => text.trim() !== '');
  console.log(`the second page says: ${refusal}`);
  await second.page.mouse.wheel(0, 500);
  // Nor may it stop time.
  await second.page.keyboard.press('Space');
  await second.page.waitForTimeout(500);
  assert.equal((await session()).state, 'SESSION_STATE_RUNNING');
  assert.equal((await account(second.page)).role, 'spectator');
  assert.equal((await account(page)).role, 'controller');
  assert.deepEqual(await target(), before);
  assert.deepEqual((await session()).operated_tools, ['needle']);
  assert.deepEqual(second.complaints, []);
  await second.close();

  // Let go, and somebody else may.
  await page.keyboard.press('Escape');
  await until('let go', async () => (await session()).operated_tools, tools => tools.length === 0);
});

test('nothing was complained about', async () => {
  assert.deepEqual((await account(page)).errors, []);
  assert.deepEqual(view.complaints, []);
});
