// What the browser tests share: a real server, its gRPC API, a real browser.

import {spawn} from 'node:child_process';
import {accessSync, constants, mkdtempSync, rmSync} from 'node:fs';
import {tmpdir} from 'node:os';
import path from 'node:path';
import readline from 'node:readline';
import {fileURLToPath} from 'node:url';
import {inflateSync} from 'node:zlib';

import grpc from '@grpc/grpc-js';
import {loadSync} from '@grpc/proto-loader';
import {chromium} from 'playwright-core';

export const ROOT = fileURLToPath(new URL('../..', import.meta.url));
export const PROGRAM = process.env.ADHESIM_PROGRAM ?? path.join(ROOT, 'build/release/adhesim');
export const FULL_SIZE = process.env.ADHESIM_TEST_SIZE === 'full';
export const SCENE = path.join(ROOT, 'scenes/training/needle_organ.yaml');
// Compiles run beside the tests: a wait is for what must come, not for how fast.
export const PATIENCE_MS = 30_000;

// Whatever is started ends with this process, however that ends.
const children = new Set();
process.on('exit', () => children.forEach(child => child.kill('SIGKILL')));

const directories = [];
process.on('exit', () => directories.forEach(name => rmSync(name, {recursive: true, force: true})));
export function temporaryDirectory() {
  directories.push(mkdtempSync(path.join(tmpdir(), 'adhesim-web-')));
  return directories.at(-1);
}

// Starts the program; `ended` becomes {code, signal, stdout, stderr}.
export function start(args, {env = {}} = {}) {
  const child = spawn(PROGRAM, args, {cwd: ROOT, env: {...process.env, ...env}});
  children.add(child);
  let stdout = '', stderr = '';
  child.stdout.on('data', text => { stdout += text; });
  child.stderr.on('data', text => { stderr += text; });
  const ended = new Promise((resolve, reject) => {
    child.on('error', reject);
    child.on('close', (code, signal) => { children.delete(child); resolve({code, signal, stdout, stderr}); });
  });
  return {kill: signal => child.kill(signal), ended};
}

// Runs the program to its end.
export const run = (...args) => start(args).ended;

// A server of the scene; ports are free ones unless given ("127.0.0.1:8080").
export async function startServer({scene = SCENE, listen = '127.0.0.1:0', http = '127.0.0.1:0', args = []} = {}) {
  const child = spawn(PROGRAM, ['serve', scene, '--listen', listen, '--http', http, '--json', ...args], {cwd: ROOT});
  children.add(child);
  let stderr = '';
  child.stderr.on('data', text => { stderr += text; });
  const ended = new Promise(resolve => child.on('close', resolve));
  const first = await Promise.race([
    new Promise(resolve => readline.createInterface(child.stdout).once('line', resolve)),
    ended.then(code => { throw new Error(`the server ended with ${code}: ${stderr}`); }),
  ]);
  const where = JSON.parse(first);
  return {
    grpc: where.grpc,
    http: where.http,
    url: `http://${where.http}`,
    api: connect(where.grpc),
    async kill(signal = 'SIGKILL') {
      child.kill(signal);
      await ended;
      children.delete(child);
    },
  };
}

const PROTO = path.join(ROOT, 'proto');
const SERVICES = grpc.loadPackageDefinition(loadSync(
    ['session_service', 'view_service', 'interaction_service'].map(name => `adhesim/v1/${name}.proto`),
    {includeDirs: [PROTO], keepCase: true, longs: Number, enums: String, defaults: true, oneofs: true})).adhesim.v1;

// The gRPC API: `await api.call('GetSession', {session})`, `await api.frame(session)`.
function connect(address) {
  const credentials = grpc.credentials.createInsecure();
  const options = {'grpc.enable_http_proxy': 0, 'grpc.max_receive_message_length': -1};
  const sessions = new SERVICES.SessionService(address, credentials, options);
  const views = new SERVICES.ViewService(address, credentials, options);
  return {
    call: (method, request = {}) => new Promise((resolve, reject) => {
      sessions[method](request, {deadline: Date.now() + PATIENCE_MS},
                       (error, response) => error ? reject(error) : resolve(response));
    }),
    // The newest frame that a new viewer is given: {step, time_s, frame}.
    frame: session => new Promise((resolve, reject) => {
      const stream = views.Watch({deadline: Date.now() + PATIENCE_MS});
      stream.on('error', reject);
      stream.on('data', response => {
        if (response.response !== 'frame') return;
        resolve(response);
        stream.cancel();
      });
      stream.write({start: {session, credits: 1}});
    }),
    close() { sessions.close(); views.close(); },
  };
}

const CHROMIUM = process.env.ADHESIM_BROWSER ?? '/usr/bin/chromium';

export async function startBrowser() {
  try {
    accessSync(CHROMIUM, constants.X_OK);
  } catch {
    throw new Error(`no browser at ${CHROMIUM}: install the package chromium`);
  }
  // No flag names a GL: with --use-gl or --use-angle the whole page is drawn in software, at half the rate.
  return chromium.launch({
    executablePath: CHROMIUM,
    args: process.getuid() === 0 ? ['--no-sandbox', '--no-proxy-server'] : ['--no-proxy-server'],
  });
}

// What a page may say as an error or warning without fault of its own.
const HARMLESS = [
  /GPU stall due to ReadPixels/,       // reading pixels back, which only the tests do
  /Automatic fallback to software WebGL/,  // the machine has no GPU
];

// A new page; `complaints` collects what it says on its console as errors, and exceptions.
export async function openPage(browser, url, {width = 800, height = 600, permit = []} = {}) {
  const context = await browser.newContext({viewport: {width, height}});
  const page = await context.newPage();
  page.setDefaultTimeout(PATIENCE_MS);
  const complaints = [];
  const note = text => {
    if (![...HARMLESS, ...permit].some(pattern => pattern.test(text))) complaints.push(text);
  };
  page.on('console', message => {
    if (message.type() === 'error') note(`${message.text()} (${message.location().url})`);
  });
  page.on('pageerror', error => note(`exception: ${error.stack ?? error}`));
  page.on('crash', () => note('the page crashed'));
  const began = performance.now();
  await page.goto(url);
  await page.waitForFunction(() => window.adhesim !== undefined && window.adhesim.framesShown > 0);
  return {page, complaints, firstFrameS: (performance.now() - began) / 1e3, close: () => context.close()};
}

// The page's account of itself.
export function account(page) {
  return page.evaluate(() => {
    const {framesReceived, framesShown, step, timeS, session, mode, hud, errors} = window.adhesim;
    return {framesReceived, framesShown, step, timeS, session, mode, hud: {...hud}, errors: [...errors],
            role: document.body.dataset.role, connection: document.body.dataset.connection};
  });
}

// Waits until `condition(await value())` and returns the value.
export async function until(what, value, condition, patienceMs = PATIENCE_MS) {
  const end = performance.now() + patienceMs;
  for (;;) {
    const now = await value();
    if (condition(now)) return now;
    if (performance.now() > end) throw new Error(`${what}: still ${JSON.stringify(now)}`);
    await new Promise(resolve => setTimeout(resolve, 50));
  }
}

// Remembers the 3-D view's pixels in the page under a name.
export function rememberPixels(page, name) {
  return page.evaluate(async name => {
    // Two frames, so that what was asked for has been painted.
    for (let i = 0; i < 2; ++i) await new Promise(resolve => requestAnimationFrame(resolve));
    const picture = await window.adhesim.pixels();
    (window.remembered ??= {})[name] = {...picture, data: new Uint8Array(picture.data)};
  }, name);
}

// The part of pixels that differ visibly (a channel by more than 8 of 255) between two remembered pictures.
export function difference(page, one, other) {
  return page.evaluate(([one, other]) => {
    const a = window.remembered[one].data, b = window.remembered[other].data;
    if (a.length !== b.length) return 1;
    let count = 0;
    for (let i = 0; i < a.length; i += 4) {
      if ([0, 1, 2].some(channel => Math.abs(a[i + channel] - b[i + channel]) > 8)) ++count;
    }
    return count / (a.length / 4);
  }, [one, other]);
}

// An 8-bit RGB or RGBA picture out of a PNG file's bytes: {width, height, channels, data}.
export function decodePng(file) {
  if (file.toString('latin1', 1, 4) !== 'PNG') throw new Error('no PNG file');
  let at = 8, width, height, channels;
  const parts = [];
  while (at < file.length) {
    const size = file.readUInt32BE(at), type = file.toString('latin1', at + 4, at + 8);
    const body = file.subarray(at + 8, at + 8 + size);
    if (type === 'IHDR') {
      [width, height, channels] = [body.readUInt32BE(0), body.readUInt32BE(4), {2: 3, 6: 4}[body[9]]];
      if (body[8] !== 8 || channels === undefined || body[12] !== 0) throw new Error('a kind of PNG not read here');
    }
    if (type === 'IDAT') parts.push(body);
    at += size + 12;
  }
  const raw = inflateSync(Buffer.concat(parts)), stride = width * channels;
  const data = new Uint8Array(stride * height);
  for (let y = 0; y < height; ++y) {
    const filter = raw[y * (stride + 1)];
    for (let x = 0; x < stride; ++x) {
      const left = x >= channels ? data[y * stride + x - channels] : 0;
      const up = y > 0 ? data[(y - 1) * stride + x] : 0;
      const corner = y > 0 && x >= channels ? data[(y - 1) * stride + x - channels] : 0;
      const [dl, du, dc] = [Math.abs(up - corner), Math.abs(left - corner), Math.abs(left + up - 2 * corner)];
      const paeth = dl <= du && dl <= dc ? left : du <= dc ? up : corner;
      const predicted = [0, left, up, (left + up) >> 1, paeth][filter];
      data[y * stride + x] = raw[y * (stride + 1) + 1 + x] + predicted;
    }
  }
  return {width, height, channels, data};
}
