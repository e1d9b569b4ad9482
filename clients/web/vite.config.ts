import { defineConfig } from "vite";

// The address of a running server for `npm run dev`.
const server = process.env.ADHESIM_SERVER ?? "http://127.0.0.1:8080";

export default defineConfig({
  // Relative paths: the page works under any prefix.
  base: "./",
  build: {
    outDir: process.env.ADHESIM_WEB_OUT ?? "../../build/web/dist",
    emptyOutDir: true,
    target: "es2022",
    // One script, nothing to preload, and nothing inlined that a content security policy would
    // refuse.
    modulePreload: false,
    assetsInlineLimit: 0,
    chunkSizeWarningLimit: 1500,
  },
  server: { proxy: { "/v1": { target: server, ws: true }, "/healthz": server } },
});
