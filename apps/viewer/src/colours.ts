// SPDX-License-Identifier: Apache-2.0
// Scales that people who see colours differently can tell apart: viridis, cividis (both by their makers' tables, nine
// stops), and the palette of Okabe and Ito for kinds.
import { Color, DataTexture, LinearFilter, RGBAFormat, SRGBColorSpace } from "three";

const scales = {
  viridis: ["#440154", "#482475", "#414487", "#355f8d", "#2a788e", "#21918c", "#22a884", "#7ad151", "#fde725"],
  cividis: ["#00224e", "#123570", "#3b496c", "#575d6d", "#707173", "#8a8678", "#a59c74", "#c3b369", "#fee838"],
  grey: ["#202020", "#3a3a3a", "#545454", "#707070", "#8c8c8c", "#a8a8a8", "#c4c4c4", "#e0e0e0", "#ffffff"],
} as const;
export type Scale = keyof typeof scales;

export const kinds = ["#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#f0e442", "#999999"];
export const ofFalse = "#d62ad6";
export const ofRefused = "#999999";
export const ofTruth = "#009e73";
export const ofOdometry = "#d55e00";

/** `at` in [0, 1]. */
export function colourAt(scale: Scale, at: number): Color {
  const stops = scales[scale];
  const place = Math.min(Math.max(Number.isFinite(at) ? at : 0, 0), 1) * (stops.length - 1);
  const low = Math.min(Math.floor(place), stops.length - 2);
  return new Color(stops[low]).lerp(new Color(stops[low + 1]), place - low);
}

export function textureOf(scale: Scale): DataTexture {
  const size = 256;
  const bytes = new Uint8Array(4 * size);
  for (let i = 0; i < size; ++i) {
    const hex = colourAt(scale, i / (size - 1)).getHex(SRGBColorSpace);
    bytes.set([hex >> 16, (hex >> 8) & 255, hex & 255, 255], 4 * i);
  }
  const texture = new DataTexture(bytes, size, 1, RGBAFormat);
  texture.magFilter = texture.minFilter = LinearFilter;
  texture.needsUpdate = true;
  return texture;
}

/** `from`: the part of the scale that is left out. */
export function gradientOf(scale: Scale, from = 0): string {
  const stops = Array.from({ length: 9 }, (_, i) => `#${colourAt(scale, from + ((1 - from) * i) / 8).getHexString()}`);
  return `linear-gradient(to right, ${stops.join(", ")})`;
}

const loops_from = 0.35;  // of viridis: what is darker is not seen on a dark page
/** Of loops, by probability from one half to one. */
export const loopColour = (probability: number): Color => colourAt("viridis", loops_from + (1 - loops_from) * (probability - 0.5) * 2);
export const loopGradient = gradientOf("viridis", loops_from);
