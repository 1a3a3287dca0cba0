#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Table and curves of the paper of Intensity Scan Context (Wang et al., ICRA 2020), with this program's beside.

usage: scripts/paper.py COMPARED [--pictures FOLDER]
COMPARED holds what `revisit compare` wrote along KITTI 00, 02 and 05 (scripts/comparison.sh): 00-..., 02-..., 05-....
Prints the table: what the paper says of a method, and the recall of the same method here at the paper's precision.
--pictures (needs matplotlib): a precision-recall curve a drive, with the paper's points, into FOLDER/paper_DRIVE.png."""
import argparse
import csv
import json
import pathlib
import sys

# Precision and recall of the paper's table; those of Kim, GLAROT3D and NBLD are quoted there from their own papers.
PAPER = {
    "00": {"Scan Context": (1.0, 0.87), "GLAROT3D": (0.86, 0.40), "NBLD": (0.92, 0.80), "DBoW2": (1.0, 0.92),
           "ISC": (1.0, 0.902)},
    "02": {"Scan Context": (0.90, 0.73), "DBoW2": (1.0, 0.806), "ISC": (0.98, 0.91)},
    "05": {"Scan Context": (1.0, 0.90), "NBLD": (0.93, 0.60), "GLAROT3D": (0.80, 0.80), "DBoW2": (1.0, 0.876),
           "ISC": (1.0, 0.912)},
}
# The rows of `revisit compare` that are the paper's method.
ROWS = {"Scan Context": ["scan-context"], "GLAROT3D": ["glarot3d"], "NBLD": ["nbld"], "DBoW2": ["visual-words"],
        "ISC": ["isc-paper-scores", "isc-program", "revisit-retrieval", "revisit"]}


def curve_of(folder):
    """Precision and recall, by falling score; nothing where the method was not run."""
    file = folder / "precision_recall.csv"
    if not file.exists():
        return None
    with open(file, encoding="ascii") as stream:
        return [(float(row["precision"]), float(row["recall"])) for row in csv.DictReader(stream)]


def recall_at(curve, precision):
    """The largest recall at which at least so many of the answers are right."""
    return max((recall for p, recall in curve if p >= precision - 5e-4), default=0.0)


def percent(share):
    return f"{100 * share:.1f}".removesuffix(".0")


def accepted_of(folder, method):
    """Precision and recall of the loops that a method accepted, at its own thresholds (table 2)."""
    file = folder / "comparison.json"
    table = json.loads(file.read_text()).get(method, {}).get("table_2") if file.exists() else None
    if not table:
        return None
    return (None if table["accepted"] == 0 else table["precision"]), table["recall"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("compared", type=pathlib.Path)
    parser.add_argument("--pictures", type=pathlib.Path)
    options = parser.parse_args()
    compared = [each.parent for each in options.compared.glob("*/comparison.json")]
    drives = sorted(each for each in compared if each.name.split("-")[0] in PAPER)
    if not drives:
        sys.exit(f"{options.compared}: holds no folder 00-..., 02-... or 05-... of `revisit compare`")
    print("| drive | method | paper: precision, recall (%) | row here | recall at that precision (%) |")
    print("|---|---|---|---|---|")
    for drive in drives:
        for method, (precision, recall) in PAPER[drive.name.split("-")[0]].items():
            for row in ROWS[method]:
                curve = curve_of(drive / row)
                here = "-" if curve is None else percent(recall_at(curve, precision))
                print(f"| {drive.name} | {method} | {percent(precision)}, {percent(recall)} | {row} | {here} |")
    print("\n| drive | at its own thresholds | precision, recall (%) |\n|---|---|---|")
    for drive in drives:
        for row, name in (("isc-paper", "ISC as printed (0.9, 0.92, 1.8)"), ("revisit", "this program")):
            found = accepted_of(drive, row)
            if found:
                print(f"| {drive.name} | {name} | "
                      f"{'no loop' if found[0] is None else percent(found[0])}, {percent(found[1])} |")
    if options.pictures:
        draw(drives, options.pictures)


def draw(drives, folder):
    import matplotlib
    matplotlib.use("Agg")
    from matplotlib import pyplot
    folder.mkdir(parents=True, exist_ok=True)
    for drive in drives:
        number = drive.name.split("-")[0]
        figure, axes = pyplot.subplots(figsize=(9, 4.8), dpi=100)
        for colour, (method, rows) in enumerate(ROWS.items()):
            for style, row in zip(("-", "--", "-.", ":"), reversed(rows)):
                curve = curve_of(drive / row)
                if curve:
                    axes.plot([r for _, r in curve], [p for p, _ in curve], style, color=f"C{colour}", label=row)
            if method in PAPER[number]:
                precision, recall = PAPER[number][method]
                axes.plot(recall, precision, "o", color=f"C{colour}", markeredgecolor="black",
                          label=f"{method}, paper (real KITTI)")
        axes.set(xlabel="recall", ylabel="precision", xlim=(0, 1.02), ylim=(0, 1.02), title=f"Along KITTI {drive.name}")
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.01, 1.0))
        figure.tight_layout()
        figure.savefig(folder / f"paper_{drive.name}.png")
        pyplot.close(figure)


if __name__ == "__main__":
    main()
