// validate.mjs FILE.glb...: Khronos' validator, installed in the working directory. Exit status 1 if there is an error or a warning.
import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';

const validator = createRequire(`${process.cwd()}/`)('gltf-validator');
let failed = false;
for (const path of process.argv.slice(2)) {
  const { issues } = await validator.validateBytes(new Uint8Array(readFileSync(path)), { maxIssues: 20 });
  console.log(`${path}: ${issues.numErrors} errors, ${issues.numWarnings} warnings, ${issues.numInfos} infos, ${issues.numHints} hints`);
  for (const issue of issues.messages) console.log(`  ${issue.code} ${issue.message} ${issue.pointer ?? ''}`);
  failed ||= issues.numErrors + issues.numWarnings > 0;
}
process.exit(failed ? 1 : 0);
