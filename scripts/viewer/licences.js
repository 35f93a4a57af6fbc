// Prints the licence of every package of which something is in the bundle that esbuild's metafile describes.
import { readFileSync, readdirSync } from "node:fs";

const [bundle] = Object.values(JSON.parse(readFileSync(process.argv[2], "utf8")).outputs);
const inputs = Object.entries(bundle.inputs).filter(([, { bytesInOutput }]) => bytesInOutput > 0);
const folder = /^(.*node_modules\/(?:@[^/]+\/)?[^/]+)\//;
const packages = new Set(inputs.map(([input]) => folder.exec(input)?.[1]).filter(Boolean));
for (const path of [...packages].sort()) {
  const { name, version, license } = JSON.parse(readFileSync(`${path}/package.json`, "utf8"));
  const file = readdirSync(path).find((entry) => /^licen[cs]e/i.test(entry));
  const words = file ? readFileSync(`${path}/${file}`, "utf8").trim() : "(the package holds no text of its licence)";
  console.log(`${name} ${version}: ${license}\n\n${words}\n\n----------------------------------------\n`);
}
