// Writes WebAssembly modules in their binary form, as far as translate.mjs and native.mjs need it.

const I32 = 0x7f;
const VOID = 0x40;

const OPS = {
  else: 0x05, return: 0x0f, i32Eqz: 0x45, eq: 0x46, ne: 0x47, ltS: 0x48, ltU: 0x49, gtU: 0x4b, geS: 0x4e, geU: 0x4f,
  i64Ne: 0x52, i64GtU: 0x56, add: 0x6a, sub: 0x6b, mul: 0x6c, and: 0x71, or: 0x72, xor: 0x73, shl: 0x74, shrS: 0x75,
  shrU: 0x76, rotr: 0x78, i64Add: 0x7c, extendI64: 0xad, extend8: 0xc0, extend16: 0xc1,
};

const MEMORY_OPS = { load: 0x28, load8: 0x2d, load16: 0x2f, i64Load: 0x29, store: 0x36, i64Store: 0x37, store8: 0x3a, store16: 0x3b };

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

  /** Plain operations by name. */
  op(first, second) {
    this.byte(OPS[first]);
    if (second) this.byte(OPS[second]);
    return this;
  }
  i32(value) {
    this.byte(0x41);
    for (value |= 0; value < -0x40 || value > 0x3f; value >>= 7) this.byte((value & 0x7f) | 0x80);
    this.byte(value & 0x7f);
    return this;
  }
  /** @param value a BigInt */
  i64(value) {
    this.byte(0x42);
    for (value = BigInt.asIntN(64, value); value < -0x40n || value > 0x3fn; value >>= 7n) {
      this.byte(Number(value & 0x7fn) | 0x80);
    }
    this.byte(Number(value & 0x7fn));
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
  tee(local) {
    this.byte(0x22);
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
  /** Store a word there. Uses a local. */
  put(address, local) {
    return this.set(local).i32(0).get(local).memory('store', address);
  }
  #open(kind) {
    this.byte(kind);
    this.byte(VOID);
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
  brIf(depth) {
    this.byte(0x0d);
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
 * Return a function that makes modules of functions.
 * @param types [parameters, results] as counts of 32-bit integers
 * @param imports [name, type] of functions of the module "env", which has `memory` as well
 * @param exported [name, type] of the functions
 * @param table whether they use the `table` of "env"
 */
export function moduleMaker(types, imports, exported, table = false) {
  const words = (count) => [count, ...Array(count).fill(I32)];
  const imported = (text, kind) => bytesOf((code) => code.text('env').text(text).append(kind));
  const head = bytesOf((code) => {
    code.append([0, 0x61, 0x73, 0x6d, 1, 0, 0, 0]);
    code.section(1, types.map(([parameters, results]) => [0x60, ...words(parameters), ...words(results)]));
    code.section(2, [
      imported('memory', [2, 0, 1]),
      ...(table ? [imported('table', [1, 0x70, 0, 0])] : []),
      ...imports.map(([text, type]) => imported(text, [0, type])),
    ]);
    code.section(3, exported.map(([, type]) => [type]));
    code.section(7, exported.map(([name], i) => bytesOf((item) => item.text(name).append([0, imports.length + i]))));
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
