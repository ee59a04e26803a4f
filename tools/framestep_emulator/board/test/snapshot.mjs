// A snapshot restores every kind of change in the same objects, and does not touch functions.

import assert from 'node:assert';
import { Session } from 'node:inspector';
import { Board } from '../lib/board.mjs';
import { Snapshot } from '../lib/snapshot.mjs';

class Part {
  constructor() {
    this.level = -0;
    this.words = new Int32Array([1, 2, 3]);
  }
  get twice() {
    return 2 * this.level;
  }
}

const bytes = new Uint8Array([1, 2, 3, 4]);
const part = new Part();
const whole = {
  part,
  again: part,
  none: null,
  act: () => 0,
  list: [1, [2, 3], part],
  table: new Map([['a', { b: 1 }]]),
  group: new Set([1, part]),
  view: new Uint16Array(bytes.buffer),
  slice: bytes.subarray(1, 3),
};
whole.self = whole;
const { table, list, words = part.words } = whole;
const inner = table.get('a');
const snapshot = new Snapshot(whole);

for (const round of [1, 2]) {
  part.level = round;
  part.words = new Int32Array(3);
  words[1] = 99;
  part.added = true;
  whole.none = { more: 1 };
  delete whole.act;
  list[1].push(4);
  list.length = 2;
  inner.b = 2;
  table.delete('a');
  table.set('c', 1);
  whole.group.clear();
  bytes.fill(7);
  snapshot.restore();
  assert.ok(Object.is(part.level, -0) && part.words === words && !('added' in part));
  assert.deepEqual([...words], [1, 2, 3]);
  assert.equal(whole.none, null);
  assert.equal(typeof whole.act, 'function');
  assert.deepEqual(list, [1, [2, 3], part]);
  assert.deepEqual([...table], [['a', { b: 1 }]]);
  assert.equal(table.get('a'), inner);
  assert.deepEqual([...whole.group], [1, part]);
  assert.deepEqual([...bytes], [1, 2, 3, 4]);
  assert.equal(whole.self, whole);
}

function* enumerate() {
  yield 1;
}
assert.throws(() => new Snapshot({ script: enumerate() }), /a Generator cannot be kept/);

// No function of a board has an object of its own in a closure that could change unnoticed.

const board = new Board({ firmware: new Uint8Array(0) });
const state = new Snapshot(board);
globalThis.known = new Set(state.kept.map(([object]) => object));
const functions = new Set(
  state.kept.flatMap(([, kind, value]) => kind.inside(value)).filter((value) => typeof value === 'function'),
);
assert.ok(functions.size > 200);
globalThis.functions = functions;

const session = new Session();
session.connect();
function post(method, parameters) {
  let answer;
  session.post(method, parameters, (error, result) => (answer = error ? assert.fail(error.message) : result)); // at once
  return answer;
}
const properties = (objectId) => post('Runtime.getProperties', { objectId, ownProperties: true });
for (const [i, fn] of [...functions].entries()) {
  const { objectId } = post('Runtime.evaluate', { expression: `[...functions][${i}]` }).result;
  const scopes = properties(objectId).internalProperties.find(({ name }) => name === '[[Scopes]]').value;
  for (const { value: scope } of properties(scopes.objectId).result) {
    if (!/^(Closure|Block)/.test(scope?.description)) continue;
    for (const { name, value } of properties(scope.objectId).result) {
      if (value?.type !== 'object' || value.subtype === 'null') continue;
      const { result } = post('Runtime.callFunctionOn', {
        objectId: value.objectId,
        functionDeclaration: 'function () { return known.has(this) || ArrayBuffer.isView(this); }',
        returnByValue: true,
      });
      assert.ok(result.value, `${name}, which a function keeps to itself: ${fn}`);
    }
  }
}
