// WebAssembly from a small part of JavaScript's text: whole numbers of 32 bits, words and arrays of the memory, calls of `core`.
//
// Statements: x=..., x+=..., a[i]=..., if, else, switch (with all cases from 0 on), L:{}, L:for(;;){}, break, continue, return, and `back`: write held words.
// Operators: all of 32 bits, where && and || evaluate both sides, and comparisons are without a sign if an operand is the result
// of >>>. Other names than those of words and arrays are locals.

import { Code } from './wasm.mjs';

const TOKEN = /\w+|>>>|===|!==|<<|>>|<=|>=|&&|\|\||\+=|\S/g;
const BINARY = {
  '||': [2, 'or'], '&&': [3, 'and'], '|': [4, 'or'], '^': [5, 'xor'], '&': [6, 'and'], '===': [7, 'eq'], '!==': [7, 'ne'],
  '<': [8, 'lt'], '>': [8, 'gt'], '<=': [8, 'le'], '>=': [8, 'ge'], '<<': [9, 'shl'], '>>': [9, 'shrS'], '>>>': [9, 'shrU'],
  '+': [10, 'add'], '-': [10, 'sub'], '*': [11, 'mul'],
};
const KINDS = { 32: ['load', 'store', 2], 16: ['load16', 'store16', 1], 8: ['load8', 'store8', 0] };

export const INDIRECT = -1;

class Assembler {
  /**
   * @param words {name: address}
   * @param held names of words that are in locals from the beginning up to each `return`, before its value is computed
   * @param arrays {name: [address, bits of an element, whether the index counts bytes]}
   * @param calls {name: index}; of INDIRECT: the argument is the function's place in the table
   */
  constructor(text, { words, held, arrays, calls }, parameters) {
    this.words = words;
    this.arrays = arrays;
    this.calls = calls;
    this.code = new Code();
    this.locals = new Map(parameters.map((name, i) => [name, i]));
    this.labels = new Map(); // depth for `break`, for `continue`
    this.tokens = text.match(TOKEN);
    const set = new Map(); // for each token whether it is set somewhere
    this.tokens.forEach((token, i, tokens) => {
      if (token >= '0' && token < ':') tokens[i] = Number(token);
      else if (token === '=') set.set(tokens[i - 1], true);
      else if (!set.has(token)) set.set(token, false);
    });
    this.at = 0;
    this.written = []; // held words: address, local
    for (const name of held) {
      if (!set.has(name)) continue;
      const local = this.local(name);
      this.code.word(words[name]).set(local);
      if (set.get(name)) this.written.push([words[name], local]);
    }
  }

  get token() {
    return this.tokens[this.at];
  }
  take(token) {
    if (this.token !== token) throw new Error(`${token} expected in ${this.tokens.slice(Math.max(0, this.at - 20), this.at + 5).join(' ')}`);
    this.at++;
  }
  next() {
    return this.tokens[this.at++];
  }
  wordOf(name) {
    return this.locals.has(name) ? undefined : this.words[name];
  }
  local(name) {
    if (!this.locals.has(name)) this.locals.set(name, this.locals.size);
    return this.locals.get(name);
  }

  block() {
    if (this.token !== '{') return this.statement();
    this.take('{');
    while (this.token !== '}') this.statement();
    this.take('}');
  }

  statement() {
    const { code } = this;
    const name = this.next();
    if (name === 'if') {
      this.take('(');
      this.expression();
      this.take(')');
      code.if();
      this.block();
      if (this.token === 'else') {
        this.take('else');
        code.op('else');
        this.block();
      }
      code.end();
      return;
    }
    if (name === 'switch') return this.switch();
    if (name === 'return') {
      this.writeBack();
      this.expression();
      code.op('return');
    } else if (name === 'break') code.br(this.labels.get(this.next())[0]);
    else if (name === 'continue') code.br(this.labels.get(this.next())[1]);
    else if (this.token === ':') return this.labelled(name);
    else if (name === 'core') this.call();
    else if (name === 'back') this.writeBack();
    else this.assign(name);
    this.take(';');
  }

  writeBack() {
    for (const [address, local] of this.written) this.code.i32(0).get(local).memory('store', address);
  }

  labelled(label) {
    const { code } = this;
    this.take(':');
    code.block();
    const outside = code.depth;
    if (this.token === '{') {
      this.labels.set(label, [outside]);
      this.block();
      code.end();
      return;
    }
    for (const token of ['for', '(', ';', ';', ')']) this.take(token);
    code.loop();
    this.labels.set(label, [outside, code.depth]);
    this.block();
    code.br(code.depth).end().end();
  }

  /** switch(x){case 0:case 1:... break;}: the cases are all numbers from 0 on. */
  switch() {
    const { code } = this;
    this.take('(');
    this.expression();
    const index = this.local('#');
    code.set(index);
    this.take(')');
    this.take('{');
    // find the cases first
    const bodies = [];
    const targets = [];
    for (let depth = 0, at = this.at, fresh = true; depth >= 0; at++) {
      const token = this.tokens[at];
      if (token === 'case' && depth === 0) {
        if (fresh) bodies.push(0);
        targets[this.tokens[at + 1]] = bodies.length - 1;
        at += 2;
        fresh = false;
        bodies[bodies.length - 1] = at + 1;
      } else {
        if (token === '{') depth++;
        else if (token === '}') depth--;
        fresh = true;
      }
    }
    code.block();
    const end = code.depth;
    const before = this.labels.get('');
    this.labels.set('', [end]);
    bodies.forEach(() => code.block());
    code.get(index).brTable([...targets, 0].map((i) => code.depth - i));
    for (const body of bodies) {
      code.end();
      this.at = body;
      while (this.token !== 'case' && this.token !== '}') {
        if (this.token === 'break' && this.tokens[this.at + 1] === ';') {
          this.at += 2;
          code.br(end);
        } else this.statement();
      }
    }
    this.take('}');
    code.end();
    this.labels.set('', before);
  }

  assign(name) {
    const { code } = this;
    if (this.token === '[') {
      const [offset, [, store]] = this.element(name);
      this.take('=');
      this.expression();
      code.memory(store, offset);
      return;
    }
    const word = this.wordOf(name);
    if (word !== undefined) code.i32(0);
    const adds = this.token === '+=';
    this.take(adds ? '+=' : '=');
    if (adds) this.variable(name);
    this.expression();
    if (adds) code.op('add');
    if (word !== undefined) code.memory('store', word);
    else code.set(this.local(name));
  }

  /** Put the address on the stack of what follows: [index]. Returns the offset and the kind. */
  element(name) {
    const { code } = this;
    const [start, bits, bytes] = this.arrays[name];
    const kind = KINDS[bits];
    const shift = bytes ? 0 : kind[2];
    this.take('[');
    if (typeof this.token === 'number' && this.tokens[this.at + 1] === ']') {
      const offset = start + (this.next() << shift);
      code.i32(0);
      this.take(']');
      return [offset, kind];
    }
    if (bytes && this.tokens[this.at + 1] === '+' && typeof this.tokens[this.at + 2] === 'number' && this.tokens[this.at + 3] === ']') {
      this.variable(this.next());
      this.take('+');
      const offset = start + this.next();
      this.take(']');
      return [offset, kind];
    }
    this.expression();
    if (shift) code.i32(shift).op('shl');
    this.take(']');
    return [start, kind];
  }

  call() {
    this.take('.');
    const name = this.next();
    const index = this.calls[name] ?? this.fail(name);
    this.values();
    if (index === INDIRECT) this.code.callIndirect(0);
    else this.code.call(index);
  }
  /** Those of a call. */
  values() {
    this.take('(');
    while (this.token !== ')') {
      this.expression();
      if (this.token === ',') this.take(',');
    }
    this.take(')');
  }
  fail(what) {
    throw new Error(`${what} is not in this language`);
  }

  variable(name) {
    const word = this.wordOf(name);
    if (word !== undefined) this.code.word(word);
    else this.code.get(this.local(name));
  }

  /** Returns whether the value has no sign. */
  primary() {
    const { code } = this;
    const token = this.next();
    if (typeof token === 'number') {
      code.i32(token);
    } else if (token === '(') {
      const unsigned = this.expression();
      this.take(')');
      return unsigned;
    } else if (token === '-') {
      if (typeof this.token === 'number') code.i32(-this.next());
      else {
        code.i32(0);
        this.primary();
        code.op('sub');
      }
    } else if (token === '~') {
      this.primary();
      code.i32(-1).op('xor');
    } else if (token === '!') {
      this.primary();
      code.op('eqz');
    } else if (token === 'core') {
      this.call();
    } else if (token === 'Math') {
      this.take('.');
      const op = { imul: 'mul', clz32: 'clz' }[this.next()];
      this.values();
      code.op(op);
    } else if (this.token === '[') {
      const [offset, [load]] = this.element(token);
      code.memory(load, offset);
    } else this.variable(token);
    return false;
  }

  expression(above = 0) {
    const { code } = this;
    let unsigned = this.primary();
    for (;;) {
      const { token } = this;
      if (token === '?' && above < 1) {
        this.take('?');
        if (this.tokens.slice(this.at, this.at + 3).join('') === '1:0') this.at += 3; // as the comparison gives it
        else {
          code.ifValue();
          this.expression();
          this.take(':');
          code.op('else');
          this.expression();
          code.end();
        }
        continue;
      }
      const [precedence, op] = BINARY[token] ?? [0];
      if (!precedence || precedence <= above) return unsigned;
      this.at++;
      if (this.token === 0 && (token === '|' || token === '>>>')) {
        this.at++;
        unsigned = token === '>>>';
        continue;
      }
      const other = this.expression(precedence);
      if (precedence === 8) code.op(op + (unsigned || other ? 'U' : 'S'));
      else code.op(op);
      unsigned = token === '>>>';
    }
  }
}

/** Returns [code, locals apart from the parameters] of a function. */
export function assemble(text, environment, parameters = []) {
  const assembler = new Assembler(text, environment, parameters);
  while (assembler.token !== undefined) assembler.statement();
  if (text.includes('return')) assembler.code.i32(0); // nothing comes here
  return [assembler.code, assembler.locals.size - parameters.length];
}
