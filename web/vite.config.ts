import { defineConfig } from "vite";

// The page is built into the package, so that its users need no Node. Names carry a hash of the
// content and nothing else: the same source gives the same bytes.
export default defineConfig({
  base: "/",
  build: {
    outDir: "../src/grebe/server/static",
    emptyOutDir: true,
    assetsInlineLimit: 0,
    target: "es2022",
    modulePreload: { polyfill: false },
    reportCompressedSize: true,
  },
  esbuild: { jsx: "automatic", jsxImportSource: "preact", legalComments: "none" },
  server: { proxy: { "/api": "http://127.0.0.1:8765" } },
});
