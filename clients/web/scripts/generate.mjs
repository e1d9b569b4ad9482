// Writes src/gen: the messages of proto/ as TypeScript. Needs protoc (Debian: protobuf-compiler);
// PROTOC names another one.
import { execFileSync } from "node:child_process";
import { mkdirSync, readdirSync, rmSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const web = dirname(dirname(fileURLToPath(import.meta.url)));
const proto = join(web, "../../proto");
const out = join(web, "src/gen");
const files = ["google/rpc", "adhesim/v1"].flatMap((folder) =>
  readdirSync(join(proto, folder))
    .filter((name) => name.endsWith(".proto"))
    .sort()
    .map((name) => `${folder}/${name}`),
);

rmSync(out, { recursive: true, force: true });
mkdirSync(out, { recursive: true });
try {
  execFileSync(
    process.env.PROTOC ?? "protoc",
    [
      `--plugin=protoc-gen-es=${join(web, "node_modules/.bin/protoc-gen-es")}`,
      `--es_out=${out}`,
      "--es_opt=target=ts",
      "-I",
      proto,
      ...files,
    ],
    { stdio: "inherit" },
  );
} catch (error) {
  console.error(
    `generate: ${error.message}\nIs protoc installed (Debian: apt-get install protobuf-compiler)?`,
  );
  process.exit(1);
}
