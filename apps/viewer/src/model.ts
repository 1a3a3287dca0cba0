// SPDX-License-Identifier: Apache-2.0
// view.json (docs/formats.md), checked as it is read.
import { Matrix4, Quaternion, Vector3 } from "three";

export type Triple = [number, number, number];

export interface Loop {
  query: number;
  match: number;
  accepted: boolean;
  score: number;
  pose?: number[];
  probability?: number;
  inlier_ratio?: number;
  rmse_m?: number;
  reason?: string;
  right?: boolean;
  error_m?: number;
  error_deg?: number;
  true_pose?: number[];
  evidence?: Record<string, number>;
}

export interface Scans {
  frame: number[];
  stamp_s: number[];
  keyframe: number[];
  pose: number[][];
  odometry: (Triple | null)[];
  truth: (Triple | null)[];
}

export interface View {
  name: string;
  title: string;
  command: string;
  input: string;
  sessions: string[];
  run: { version?: string; counts?: Record<string, number>; ms_per_scan?: Record<string, number>; memory_mb?: [number, number][]; interrupted?: boolean };
  north_deg?: number;
  problems: string[];
  has_truth: boolean;
  has_tiles: boolean;
  revisits: number;
  scans: Scans;
  loops: Loop[];
  answers: [number, number | null, number, number | null][];
  index: Map<number, number>;
}

export function toView(name: string, json: any): View {
  if (json?.format !== "revisit view" || json.version !== 1)
    throw new Error(`${name}/view.json: is no view of version 1; this page and the program differ`);
  const scans = json.scans as Scans;
  if (!Array.isArray(scans?.frame) || scans.pose.length !== scans.frame.length || !Array.isArray(json.loops))
    throw new Error(`${name}/view.json: scans and poses differ in number`);
  return { ...json, name, index: new Map(scans.frame.map((frame, i) => [frame, i])) };
}

export function toMatrix(pose: number[]): Matrix4 {
  const [x, y, z, qx, qy, qz, qw] = pose as [number, number, number, number, number, number, number];
  return new Matrix4().compose(new Vector3(x, y, z), new Quaternion(qx, qy, qz, qw), new Vector3(1, 1, 1));
}

export function positionOf(view: View, frame: number): Triple | null {
  const i = view.index.get(frame);
  return i === undefined ? null : (view.scans.pose[i]!.slice(0, 3) as Triple);
}

const kSessionStep = 2 ** 40;

/** "12", or "2:12" for frame 12 of session 2. */
export function frameName(frame: number): string {
  const session = Math.floor(frame / kSessionStep);
  return session > 0 ? `${session}:${frame % kSessionStep}` : String(frame);
}

export const sessionOf = (frame: number): number => Math.floor(frame / kSessionStep);
