"""Print the table of loss against time and frames that `vpltune bench tuning` left in out/tuning.

python scripts/tuning_table.py
"""

import json

from benchmarks.tuning import FOLDER, WITHIN, best_loss, rows_of, time_to


def main() -> None:
    """One line for each scene and search, then the rows of the benchmark."""
    scenes = [json.loads(path.read_text(encoding="utf-8")) for path in sorted(FOLDER.glob("*.json"))]
    if not scenes:
        raise SystemExit(f"{FOLDER}: nothing measured yet; run `vpltune bench tuning` first")
    print("| scene | search | loss over best | seconds to 1 % | times ours | frames | evaluations |")
    print("|---|---|---|---|---|---|---|")
    for scene in scenes:
        best = best_loss(scene)
        aim = best + WITHIN * abs(best)
        ours, _ = time_to(scene["searches"]["ours"], aim)
        for name, search in scene["searches"].items():
            seconds, there = time_to(search, aim)
            bound = "" if there else "≥ "
            print(
                f"| {scene['scene']} | {name} | {min(search['losses']) / best:.4f} | {bound}{seconds:.3g} |"
                f" {bound}{seconds / ours:.3g} | {search['frames'][-1]} | {search['evaluations']} |"
            )
        for name, loss in scene["losses"].items():
            print(f"| {scene['scene']} | {name} | {loss / best:.4g} | | | | |")
    print()
    for row in rows_of(scenes):
        print(f"{row.name}: {row.ratio:.3g} ({row.against})")


if __name__ == "__main__":
    main()
