// SPDX-License-Identifier: Apache-2.0
// One script and one style sheet with names that stay: the program carries them.
import { copyFileSync } from "node:fs";

export default {
  build: {
    target: "es2022",
    modulePreload: false,
    chunkSizeWarningLimit: 2000,
    rollupOptions: {
      input: "src/main.ts",
      output: { entryFileNames: "viewer.js", assetFileNames: "viewer[extname]", inlineDynamicImports: true },
    },
  },
  plugins: [{ name: "page", closeBundle: () => copyFileSync("index.html", "dist/index.html") }],
};
