// The server is killed and comes back on the same ports: the page says so, and goes on by itself.

import assert from 'node:assert/strict';
import {test} from 'node:test';

import {account, openPage, startBrowser, startServer, until} from './support.mjs';

test('a killed server is told by a banner; when it is back the page goes on', async t => {
  const browser = await startBrowser();
  t.after(() => browser.close());
  const first = await startServer();
  // While there is no server the browser itself writes about each attempt.
  const {page, complaints} = await openPage(browser, `${first.url}/?scene=needle_organ`, {
    permit: [/ERR_CONNECTION_REFUSED/, /ERR_CONNECTION_RESET/, /WebSocket connection to/],
  });
  const banner = page.locator('#banner');
  await until('connected', () => account(page), ({connection}) => connection === 'connected');
  assert.equal(await banner.isVisible(), false);

  first.api.close();
  await first.kill('SIGKILL');
  await until('reconnecting', () => account(page), ({connection}) => connection === 'reconnecting');
  assert.equal(await banner.isVisible(), true);
  assert.notEqual((await banner.textContent()).trim(), '');
  const {framesReceived} = await account(page);

  const second = await startServer({listen: first.grpc, http: first.http});
  t.after(() => { second.api.close(); return second.kill(); });
  const now = await until('connected again', () => account(page),
                          now => now.connection === 'connected' && now.framesReceived > framesReceived + 10);
  assert.equal(await banner.isVisible(), false);
  // The old session died with the old server: this is another, and the API knows it.
  const {session} = await second.api.call('GetSession', {session: now.session});
  assert.equal(session.scene, 'needle_organ');
  assert.deepEqual(complaints, []);
});
