// `adhesim render`: pictures of chosen instants without a display.

import assert from 'node:assert/strict';
import {readdirSync, readFileSync} from 'node:fs';
import path from 'node:path';
import {test} from 'node:test';

import {decodePng, run, SCENE, start, temporaryDirectory, until} from './support.mjs';

function read(directory, name) {
  return decodePng(readFileSync(path.join(directory, name)));
}

// The part of pixels that are not of the most frequent colour: 0 for a blank picture.
function busy({data, channels}) {
  const counts = new Map();
  for (let i = 0; i < data.length; i += channels) {
    const colour = (data[i] << 16) | (data[i + 1] << 8) | data[i + 2];
    counts.set(colour, (counts.get(colour) ?? 0) + 1);
  }
  return 1 - Math.max(...counts.values()) / (data.length / channels);
}

// Pictures of the same size and kind: the part of pixels that differ by more than 8 of 255 in a channel.
function different(one, other) {
  let count = 0;
  for (let i = 0; i < one.data.length; i += one.channels) {
    if ([0, 1, 2].some(channel => Math.abs(one.data[i + channel] - other.data[i + channel]) > 8)) ++count;
  }
  return count / (one.data.length / one.channels);
}

test('a scene before contact and pressed: two pictures that are not blank and differ', async () => {
  const directory = temporaryDirectory();
  const {code, stdout, stderr} = await run('render', SCENE, '--at', '0.5', '3.5', '--out', directory,
                                           '--size', '640x480', '--colour-map', 'displacement');
  assert.equal(code, 0, stderr);
  const names = readdirSync(directory).sort();
  assert.deepEqual(names, ['needle_organ-t0.500s.png', 'needle_organ-t3.500s.png']);
  for (const name of names) assert.match(stdout, new RegExp(name.replaceAll('.', '\\.')));
  const pictures = names.map(name => read(directory, name));
  for (const picture of pictures) {
    assert.deepEqual([picture.width, picture.height], [640, 480]);
    assert.ok(busy(picture) > 0.05, 'a blank picture');
  }
  assert.ok(different(...pictures) > 0.005, 'the same picture twice');
});

test('a recording gives the same pictures as the scene that it is of', async () => {
  const directory = temporaryDirectory();
  const recording = path.join(directory, 'press.mcap');
  assert.equal((await run('run', SCENE, '--seconds', '2', '--record', recording)).code, 0);
  for (const [source, out] of [[SCENE, 'scene'], [recording, 'recording']]) {
    const {code, stderr} = await run('render', source, '--at', '2', '--out', path.join(directory, out), '--size', '320x240');
    assert.equal(code, 0, stderr);
  }
  const ofScene = read(path.join(directory, 'scene'), 'needle_organ-t2.000s.png');
  const ofRecording = read(path.join(directory, 'recording'), 'press-t2.000s.png');
  assert.ok(different(ofScene, ofRecording) < 0.002, 'another picture');

  const {code, stderr} = await run('render', recording, '--at', '2.5', '--out', directory);
  assert.equal(code, 2);
  assert.match(stderr, /ends at 2\.000 s/);
});

// Processes whose command line names a directory.
function processesIn(directory) {
  return readdirSync('/proc').filter(name => /^[0-9]+$/.test(name)).filter(name => {
    try {
      return readFileSync(`/proc/${name}/cmdline`, 'latin1').includes(directory);
    } catch {
      return false;  // it has ended meanwhile
    }
  });
}

test('nothing stays behind: not after the end, not after Ctrl-C, and no browser after kill -9', async () => {
  for (const signal of [undefined, 'SIGINT', 'SIGKILL']) {
    const [temporary, out] = [temporaryDirectory(), temporaryDirectory()];
    const rendering = start(['render', SCENE, '--at', '0.01', '--out', out], {env: {TMPDIR: temporary}});
    if (signal !== undefined) {
      await until('a browser', () => processesIn(temporary).length, count => count > 0);
      rendering.kill(signal);
    }
    const {code, stderr} = await rendering.ended;
    assert.equal(code, {undefined: 0, SIGINT: 130, SIGKILL: null}[signal], stderr);
    if (signal !== 'SIGKILL') assert.deepEqual(readdirSync(temporary), []);
    await until('no process', () => processesIn(temporary), processes => processes.length === 0);
  }
});

test('mistakes are told, with the contract\'s exit codes', async () => {
  const directory = temporaryDirectory();
  for (const [args, code, text] of [
    [['no_such_scene.yaml', '--at', '1'], 2, /no_such_scene/],
    [[SCENE, '--at', '-1'], 2, /--at/],
    [[SCENE, '--at', '0.1', '--size', '0x0'], 2, /--size/],
    [[SCENE, '--at', '0.1', '--browser', '/no/such/browser'], 2, /no\/such\/browser/],
    [[SCENE, '--at', '0.1', '--colour-map', 'plaid'], 2, /--colour-map/],
  ]) {
    const result = await run('render', ...args, '--out', directory);
    assert.equal(result.code, code, `${args}: ${result.stderr}`);
    assert.match(result.stderr, text);
  }
  assert.deepEqual(readdirSync(directory), []);
});
