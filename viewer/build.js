// One page with everything in it: usv_gym/replay/viewer/viewer.html, with places left for title and data.

import { createHash } from "node:crypto";
import { readFileSync, readdirSync, writeFileSync } from "node:fs";
import { build } from "esbuild";

const bundle = async (entry) => {
  const result = await build({ entryPoints: [entry], bundle: true, minify: true, format: "iife", target: "es2022", legalComments: "inline", write: false });
  return result.outputFiles[0].text.trim();
};

const hash = createHash("sha256");
for (const name of readdirSync("src").sort()) hash.update(readFileSync(`src/${name}`));
const parts = { STYLE: await bundle("src/style.css"), SCRIPT: `/* built from viewer/src ${hash.digest("hex")} */\n${await bundle("src/main.js")}` };
let page = readFileSync("src/page.html", "utf8");
for (const [key, text] of Object.entries(parts)) page = page.replace(`@@${key}@@`, () => text);
writeFileSync("../usv_gym/replay/viewer/viewer.html", page);
console.log(`viewer.html: ${page.length} bytes`);
