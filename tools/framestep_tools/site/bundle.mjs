// Bundles a static page: node bundle.mjs CONSOLE OUT NAME [WORKER...]. CONSOLE is the console's page as a server sends it,
// with setup.json; page/NAME.js begins. A WORKER is a module of the emulated board.

import fs from 'node:fs';
import { createRequire } from 'node:module';
import path from 'node:path';
import { fileURLToPath } from 'node:url';

const HERE = path.dirname(fileURLToPath(import.meta.url));
const BOARD = path.join(HERE, '..', '..', 'framestep_emulator', 'board');
const MODULES = path.join(BOARD, 'node_modules');
const esbuild = createRequire(path.join(BOARD, 'package.json'))('esbuild');

const [console_, out, name, ...workers] = process.argv.slice(2);
const common = {
  bundle: true,
  minify: true,
  legalComments: 'none', // licences.txt has them all
  metafile: true,
  nodePaths: [MODULES],
  target: 'es2022',
};
const made = await Promise.all([
  esbuild.build({
    ...common,
    entryPoints: [path.join(HERE, 'page', `${name}.js`)],
    format: 'esm',
    alias: { 'framestep-console': console_ },
    outdir: out,
  }),
  ...workers.map((worker) => esbuild.build({
    ...common,
    entryPoints: [path.join(BOARD, `${worker}.mjs`)],
    format: 'iife',
    outfile: path.join(out, `board_${worker}.js`),
  })),
]);

/** Return the packages in the bundle, and their licences. */
function licences() {
  const packages = new Set();
  for (const { metafile } of made) {
    for (const input of Object.keys(metafile.inputs)) {
      const found = /node_modules\/((?:@[^/]+\/)?[^/]+)\//.exec(input);
      if (found) packages.add(found[1]);
    }
  }
  return [...packages].sort().map((name) => {
    const folder = path.join(MODULES, name);
    const { version, license } = JSON.parse(fs.readFileSync(path.join(folder, 'package.json')));
    const file = fs.readdirSync(folder).find((each) => each.startsWith('LICENSE'));
    return `${name} ${version} (${license})\n\n${fs.readFileSync(path.join(folder, file), 'utf8').trim()}\n`;
  });
}

fs.writeFileSync(path.join(out, 'licences.txt'), licences().join(`\n${'-'.repeat(72)}\n\n`));
