import { readdirSync } from "node:fs";
import { defineConfig } from "vite";

// Bundles the unit tests for Node, so that they need no other runner than node:test.
export default defineConfig({
  build: {
    ssr: true,
    outDir: ".test",
    emptyOutDir: true,
    target: "node20",
    rollupOptions: {
      input: readdirSync("test")
        .filter((name) => name.endsWith(".test.ts"))
        .map((name) => `test/${name}`),
    },
  },
  logLevel: "warn",
});
