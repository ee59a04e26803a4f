// Writes WebAssembly modules in their binary form, as far as assemble.mjs and native.mjs need it.

const I32 = 0x7f;
const VOID = 0x40;

const OPS = {
  else: 0x05, return: 0x0f, eqz: 0x45, eq: 0x46, ne: 0x47, ltS: 0x48, ltU: 0x49, gtS: 0x4a, gtU: 0x4b, leS: 0x4c, leU: 0x4d,
  geS: 0x4e, geU: 0x4f, clz: 0x67, add: 0x6a, sub: 0x6b, mul: 0x6c, and: 0x71, or: 0x72, xor: 0x73, shl: 0x74, shrS: 0x75, shrU: 0x76,
};

const MEMORY_OPS = { load: 0x28, load8: 0x2d, load16: 0x2f, store: 0x36, store8: 0x3a, store16: 0x3b };

/** Bytes of a module or of the body of a function. `depth` counts the blocks that are open. */
export class Code {
  constructor() {
    this.bytes = new Uint8Array(256);
    this.length = 0;
    this.depth = 0;
  }

  byte(value) {
    if (this.length === this.bytes.length) {
      const longer = new Uint8Array(2 * this.length);
      longer.set(this.bytes);
      this.bytes = longer;
    }
    this.bytes[this.length++] = value;
  }
  unsigned(value) {
    for (; value > 0x7f; value >>>= 7) this.byte((value & 0x7f) | 0x80);
    this.byte(value);
  }
  append(bytes) {
    const length = this.length + bytes.length;
    if (length > this.bytes.length) {
      const longer = new Uint8Array(2 * length);
      longer.set(this.bytes);
      this.bytes = longer;
    }
    this.bytes.set(bytes, this.length);
    this.length = length;
    return this;
  }
  get content() {
    return this.bytes.subarray(0, this.length);
  }

  /** A plain operation by name. */
  op(name) {
    this.byte(OPS[name]);
    return this;
  }
  i32(value) {
    this.byte(0x41);
    for (value |= 0; value < -0x40 || value > 0x3f; value >>= 7) this.byte((value & 0x7f) | 0x80);
    this.byte(value & 0x7f);
    return this;
  }
  get(local) {
    this.byte(0x20);
    this.byte(local);
    return this;
  }
  set(local) {
    this.byte(0x21);
    this.byte(local);
    return this;
  }
  /** A load or a store; its address is the operand plus `offset`. */
  memory(name, offset) {
    this.byte(MEMORY_OPS[name]);
    this.byte(0);
    this.unsigned(offset);
    return this;
  }
  /** The word at a constant address. */
  word(address) {
    return this.i32(0).memory('load', address);
  }
  #open(kind, result = VOID) {
    this.byte(kind);
    this.byte(result);
    this.depth++;
    return this;
  }
  block() {
    return this.#open(0x02);
  }
  loop() {
    return this.#open(0x03);
  }
  if() {
    return this.#open(0x04);
  }
  /** An if whose branches leave a value. */
  ifValue() {
    return this.#open(0x04, I32);
  }
  end() {
    this.byte(0x0b);
    this.depth--;
    return this;
  }
  /** Leave the block that was opened at this depth, or begin that loop again. */
  br(depth) {
    this.byte(0x0c);
    this.unsigned(this.depth - depth);
    return this;
  }
  brTable(depths) {
    this.byte(0x0e);
    this.unsigned(depths.length - 1);
    for (const depth of depths) this.unsigned(this.depth - depth);
    return this;
  }
  call(index) {
    this.byte(0x10);
    this.unsigned(index);
    return this;
  }
  callIndirect(type) {
    this.byte(0x11);
    this.unsigned(type);
    this.byte(0);
    return this;
  }

  section(id, items) {
    const inside = new Code();
    inside.unsigned(items.length);
    for (const item of items) inside.append(item);
    this.byte(id);
    this.unsigned(inside.length);
    this.append(inside.content);
  }
  text(text) {
    this.unsigned(text.length);
    for (let i = 0; i < text.length; i++) this.byte(text.charCodeAt(i));
    return this;
  }
}

function bytesOf(write) {
  const code = new Code();
  write(code);
  return code.content;
}

/**
 * Return a function that makes modules of functions. A function's type: how many 32-bit integers are its parameters, and its results.
 * @param indirect type of the functions in a table, of which the module has call_indirect, if `table`
 * @param imports [name, type] of functions of the module "env", which has `memory` and `table` as well
 * @param exported [name, type] of the functions
 */
export function moduleMaker(indirect, imports, exported, table) {
  const words = (count) => [count, ...Array(count).fill(I32)];
  const imported = (text, kind) => bytesOf((code) => code.text('env').text(text).append(kind));
  const types = [String(indirect)];
  const typeOf = ([, type]) => {
    if (!types.includes(String(type))) types.push(String(type));
    return types.indexOf(String(type));
  };
  const ofImports = imports.map(typeOf);
  const ofExported = exported.map(typeOf);
  const head = bytesOf((code) => {
    code.append([0, 0x61, 0x73, 0x6d, 1, 0, 0, 0]);
    code.section(1, types.map((type) => type.split(',').map(Number)).map(([parameters, results]) => [0x60, ...words(parameters), ...words(results)]));
    code.section(2, [
      imported('memory', [2, 0, 1]),
      ...(table ? [imported('table', [1, 0x70, 0, 0])] : []), // V8 tells each change of a table to all modules that have it
      ...imports.map(([text], i) => imported(text, [0, ofImports[i]])),
    ]);
    code.section(3, ofExported.map((type) => [type]));
    code.section(7, exported.map(([name], i) => bytesOf((item) => item.text(name).append([0]).unsigned(imports.length + i))));
  });

  /** @param functions [code, locals], in the order of `exported`; locals: 32-bit integers apart from the parameters */
  return (...functions) => {
    const module = new Code().append(head);
    const bodies = functions.map(([code, locals]) => {
      const declared = locals ? [1, locals, I32] : [0];
      const body = new Code();
      body.unsigned(declared.length + code.length + 1);
      body.append(declared).append(code.content).byte(0x0b);
      return body.content;
    });
    module.section(10, bodies);
    return module.content;
  };
}
